"""What was measured in the images of a jumper: points P1 to P4 and points on the axes of the skis, pulse by pulse.

Image coordinates are px, pixel frame of `svev-network/1` (x right, y down, (0, 0) = centre of the top-left pixel).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.pulse import PulseNumber

#: P1 helmet, P2 hip, P3 right and P4 left binding (Fig. 6).
POINTS: Final = ("P1", "P2", "P3", "P4")
#: The skis.
SIDES: Final = ("right", "left")
#: The binding of each ski.
BINDING_OF: Final = {"right": "P3", "left": "P4"}


class Source(StrEnum):
    """Who measured."""

    AUTOMATIC = "automatic"
    BY_HAND = "by hand"


@dataclass(frozen=True, slots=True, eq=False)
class PointMeasurement:
    """A point in one image.

    Attributes:
        xy: (2,) px.
        covariance: (2, 2) px^2.
        source: who measured it.
    """

    xy: Floats
    covariance: Floats
    source: Source = Source.AUTOMATIC


@dataclass(frozen=True, slots=True, eq=False)
class SkiMeasurement:
    """A ski in one image: points on its axis, the line in space through tail, binding and tip.

    Attributes:
        xy: (k, 2) px, k >= 2, in any order along the ski.
        sigma: (k,) px, standard deviation across the ski; errors of different points are independent.
        source: who measured it.
        common: px, standard deviation of an error across the ski that all points share (the axis as seen is not that
            of the ski); 0 where there is none.
        lasting: px, standard deviation of what neighbouring pulses share of the shift and of the turn, at the two
            points that stand for the ski; 0 where there is none.
    """

    xy: Floats
    sigma: Floats
    source: Source = Source.AUTOMATIC
    common: float = 0.0
    lasting: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class ImageMeasurements:
    """What was measured in one image.

    Attributes:
        points: by name; those that were not measured are left out.
        skis: by side; likewise.
    """

    points: Mapping[str, PointMeasurement]
    skis: Mapping[str, SkiMeasurement]


@dataclass(frozen=True, slots=True, eq=False)
class PulseMeasurements:
    """What was measured in the images of one pulse.

    Attributes:
        pulse: its number in the recording.
        time: when it fired, UTC.
        images: by camera; a camera without a frame, or without anything measured, may be left out.
    """

    pulse: PulseNumber
    time: UtcNs
    images: Mapping[str, ImageMeasurements]


@dataclass(frozen=True, slots=True, eq=False)
class JumpMeasurements:
    """A jump, from the first pulse in which the jumper is in sight to the last.

    Attributes:
        number: counted from 1 in the recording.
        pulses: in order, also those in which nothing was measured.
    """

    number: int
    pulses: tuple[PulseMeasurements, ...]


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredCamera:
    """A camera as far as its measurements need it.

    Attributes:
        size: width and height of its images, px.
        exposure_s: exposure time. A measured position is true at its middle, half of it after the pulse.
    """

    size: tuple[int, int]
    exposure_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Measurements:
    """Everything that was measured in the images of a recording's jumps.

    Attributes:
        recording: its name.
        rate_hz: pulses per second.
        cameras: by name, in the order of the log.
        jumps: in order.
    """

    recording: str
    rate_hz: float
    cameras: Mapping[str, MeasuredCamera]
    jumps: tuple[JumpMeasurements, ...]

    @property
    def middle_s(self) -> float:
        """How long after its pulse a result is true, s: at the middle of the exposures, their mean if they differ."""
        halves = [camera.exposure_s / 2 for camera in self.cameras.values()]
        return sum(halves) / len(halves) if halves else 0.0

    def late_s(self, camera: str) -> float:
        """How much later than `middle_s` the middle of a camera's exposure is, s."""
        there = self.cameras.get(camera)
        return 0.0 if there is None else there.exposure_s / 2 - self.middle_s
