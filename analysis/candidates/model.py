"""What may be a marker in single images: places with covariance, not yet named.

Image coordinates are px, pixel frame of `svev-network/1` (x right, y down, (0, 0) = centre of the top-left pixel).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from analysis.candidates.foreground.background import Region
from analysis.candidates.markers.known_discs import DiscShape
from rig.arrays import Flags, Floats, Integers
from rig.clocks import UtcNs
from rig.pulse import PulseNumber


@dataclass(frozen=True, slots=True, eq=False)
class Spots:
    """n spots that may be markers.

    Attributes:
        xy: (n, 2) centres, px.
        covariance: (n, 2, 2) px^2.
        radius: (n,) px.
        contrast: (n,) grey values against what is around it; negative: darker.
        strength: (n,) how sure it is that a spot is there: contrast over its own standard deviation.
    """

    xy: Floats
    covariance: Floats
    radius: Floats
    contrast: Floats
    strength: Floats

    def __len__(self) -> int:
        return len(self.xy)

    @classmethod
    def none(cls) -> "Spots":
        """No spot."""
        return cls(np.empty((0, 2)), np.empty((0, 2, 2)), np.empty(0), np.empty(0), np.empty(0))

    @classmethod
    def joined(cls, parts: Sequence["Spots"]) -> "Spots":
        """All spots of several parts of an image."""
        if not parts:
            return cls.none()
        return cls(
            np.concatenate([part.xy for part in parts]),
            np.concatenate([part.covariance for part in parts]),
            np.concatenate([part.radius for part in parts]),
            np.concatenate([part.contrast for part in parts]),
            np.concatenate([part.strength for part in parts]),
        )

    def only(self, chosen: Integers | Flags) -> "Spots":
        """Some of them."""
        return Spots(
            self.xy[chosen], self.covariance[chosen], self.radius[chosen], self.contrast[chosen], self.strength[chosen]
        )


@dataclass(frozen=True, slots=True, eq=False)
class ImageCandidates:
    """Candidates of one image.

    Attributes:
        spots: that may be markers.
    """

    spots: Spots


@dataclass(frozen=True, slots=True, eq=False)
class PulseCandidates:
    """Candidates of all images of a pulse.

    Attributes:
        pulse: its number in the recording.
        time: when it fired, UTC.
        images: by camera; a camera that delivered no frame is left out.
    """

    pulse: PulseNumber
    time: UtcNs
    images: Mapping[str, ImageCandidates]


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """Where an image is expected to show a jumper.

    Attributes:
        markers: (n, 2) places of his markers, px.
        reach: (n,) px by which each may be off, with its own size.
        box: (2, 2) smallest and largest column and row (in this order) in which he and his skis may be, px.
    """

    markers: Floats
    reach: Floats
    box: Floats


class SecondLook(Protocol):
    """Looks again at places of images where markers are expected (`finder.Finder`)."""

    def look_for_spots(self, pulses: Sequence[PulseNumber], camera: str, xy: Floats, covariance: Floats) -> list[Spots]:
        """Spots near each predicted place xy (n, 2) with covariance (n, 2, 2), px, on weaker evidence."""
        ...

    def part(self, pulse: PulseNumber, camera: str, low: Integers, high: Integers) -> Region | None:
        """A part of an image before the static scene, from its first column and row to behind its last ones."""
        ...

    def fit_discs(self, pulses: Sequence[PulseNumber], camera: str, xy: Floats, shape: DiscShape) -> Spots:
        """A disc of known size near each of the places xy (n, 2), px; NaN where there is none."""
        ...
