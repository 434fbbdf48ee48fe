"""Cross sections of long thin things: in each column of an image, where a bright or dark bar has its two edges.

Pixels of one column are used as they are, so the noise of different columns is independent. Edges are extrema of the
derivative of the slightly smoothed column; two edges of opposite sign that follow each other make a bar, whose middle
is free of errors that both share (blur, threshold, halo). For things that are steeper than 45 degrees the image is
transposed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.scene.static_image import GreyImage
from rig.arrays import Flags, Floats, Integers

_SMOOTH = (
    np.array([1.0, 2.0, 0.0, -2.0, -1.0]) / 8
)  # derivative of (1 2 1) / 4 along a column, over two pixels each way
_EDGE = 4.0  # times the noise of the derivative


@dataclass(frozen=True, slots=True, eq=False)
class Bars:
    """n cross sections; px in the region.

    Attributes:
        column: (n,) whole number.
        first, last: (n,) rows of the upper and the lower edge.
        sigma: (n,) of an edge.
        contrast: (n,) grey values of the weaker edge; negative: dark.
        front: (n,) whether it is in front of the static scene.
    """

    column: Integers
    first: Floats
    last: Floats
    sigma: Floats
    contrast: Floats
    front: Flags

    @property
    def width(self) -> Floats:
        """(n,) px, along the column."""
        return self.last - self.first

    def only(self, chosen: Flags | Integers) -> "Bars":
        """Some of them."""
        return Bars(
            self.column[chosen],
            self.first[chosen],
            self.last[chosen],
            self.sigma[chosen],
            self.contrast[chosen],
            self.front[chosen],
        )


def find_bars(grey: GreyImage, noise: float, front: NDArray[np.bool_], widest: float) -> Bars:
    """All bars in the columns of an image.

    Args:
        grey: (rows, columns).
        noise: of a grey value.
        front: (rows, columns) what is in front of the static scene.
        widest: px.
    """
    rows = grey.shape[0]
    slope = np.zeros(grey.shape)
    for k, weight in enumerate(_SMOOTH):
        slope[2 : rows - 2] -= weight * grey[k : rows - 4 + k]
    noise_of_slope = noise * float(np.sqrt((_SMOOTH**2).sum()))
    size = np.abs(slope)
    here, above, below = slope[1:-1], slope[:-2], slope[2:]
    sign = np.sign(here)
    peak = (size[1:-1] > _EDGE * noise_of_slope) & (here * sign >= above * sign) & (here * sign > below * sign)
    column, row = np.nonzero(peak.T)
    row = row + 1
    left, middle, right = (np.asarray(slope[row + k, column]) for k in (-1, 0, 1))
    bend = left - 2 * middle + right
    place = row + 0.5 * (left - right) / np.where(bend == 0, np.inf, bend)
    # the extremum moves by the noise of the slope's own slope over its curvature
    sigma = noise * _NOISE_OF_BEND / np.maximum(np.abs(bend), 1e-6)
    follows = (column[1:] == column[:-1]) & (np.sign(middle[1:]) != np.sign(middle[:-1]))
    follows &= place[1:] - place[:-1] <= widest
    i = np.flatnonzero(follows)
    weaker = np.minimum(np.abs(middle[i]), np.abs(middle[i + 1]))
    centre = np.rint((place[i] + place[i + 1]) / 2).astype(int)
    return Bars(
        column[i],
        place[i],
        place[i + 1],
        np.hypot(sigma[i], sigma[i + 1]) / np.sqrt(2),
        2 * np.sign(middle[i]) * weaker,
        front[np.clip(centre, 0, rows - 1), column[i]],
    )


def _noise_of_bend() -> float:
    """Standard deviation of half the difference of neighbouring slopes for noise 1."""
    kernel = np.zeros(len(_SMOOTH) + 2)
    kernel[2:] += _SMOOTH / 2
    kernel[:-2] -= _SMOOTH / 2
    return float(np.sqrt((kernel**2).sum()))


_NOISE_OF_BEND = _noise_of_bend()
