"""What may be a marker or a ski in single images: places with covariance, not yet named.

Image coordinates are px, pixel frame of `svev-network/1` (x right, y down, (0, 0) = centre of the top-left pixel).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from analysis.candidates.markers.known_discs import DiscShape
from rig.arrays import Flags, Floats, Integers
from rig.clocks import UtcNs
from rig.pulse import PulseNumber

EXPECTED_SIGMAS: Final = 3.0  #: of its prediction, by which an expected ski may be off


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
class Trace:
    """A long thin straight thing that may be a ski, or a part of one.

    Attributes:
        xy: (k, 2) points on its axis, midway between its two edges, from one end to the other, px.
        sigma: (k,) px, standard deviation of each across the axis; errors of different points are independent.
        common: px, standard deviation of an error across the axis that all points share.
        ends: (2, 2) px, where it visibly ends; a body, the other ski or a low contrast may hide more of it.
        width: px, from edge to edge.
        contrast: grey values against what is around it; negative: darker.
        one_sided: (k,) by how much the points move across the axis, to the side (-y, x) of its direction (x, y) from
            end to end, if half of the width grows by 1: 0 where both edges are seen, -1 or 1 where one is.
        widening: (k,) by how much half of the width is larger there than `width / 2`, px; NaN where nothing tells.
        width_spread: standard deviation of the logarithm of `width`.
        of_width: px, the part of `common` and `lasting` that the uncertainty of the width makes.
        lasting: px, the part of `common` that neighbouring images share.
    """

    xy: Floats
    sigma: Floats
    common: float
    ends: Floats
    width: float
    contrast: float
    one_sided: Floats
    widening: Floats
    width_spread: float
    of_width: float
    lasting: float


@dataclass(frozen=True, slots=True, eq=False)
class ImageCandidates:
    """Candidates of one image.

    Attributes:
        spots: that may be markers.
        traces: that may be skis.
    """

    spots: Spots
    traces: Sequence[Trace]


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
class ExpectedSki:
    """Where an image is expected to show a ski.

    Attributes:
        ends: (2, 2) ends of its axis, px.
        width: px, from edge to edge.
        brighter: than what is behind it.
        sigma: px, standard deviation of the axis to the side, at its worse end.
    """

    ends: Floats
    width: float
    brighter: bool
    sigma: float

    @property
    def near(self) -> bool:
        """Whether a fit can start from there: it finds a ski that is off by less than its width."""
        return EXPECTED_SIGMAS * self.sigma < self.width


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """Where an image is expected to show a jumper.

    Attributes:
        markers: (n, 2) places of his markers, px.
        reach: (n,) px by which each may be off, with its own size.
        box: (2, 2) smallest and largest column and row (in this order) in which he and his skis may be, px.
        skis: both; empty if nothing is known of them.
    """

    markers: Floats
    reach: Floats
    box: Floats
    skis: tuple[ExpectedSki, ...] = ()


class SecondLook(Protocol):
    """Looks again at places of images where markers are expected (`finder.Finder`)."""

    def look_for_spots(self, pulses: Sequence[PulseNumber], camera: str, xy: Floats, covariance: Floats) -> list[Spots]:
        """Spots near each predicted place xy (n, 2) with covariance (n, 2, 2), px, on weaker evidence."""
        ...

    def fit_discs(self, pulses: Sequence[PulseNumber], camera: str, xy: Floats, shape: DiscShape) -> Spots:
        """A disc of known size near each of the places xy (n, 2), px; NaN where there is none."""
        ...
