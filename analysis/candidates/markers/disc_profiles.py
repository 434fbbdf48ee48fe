"""Profiles of discs that a lens and the pixels blur, as a table: what fits of many discs look up."""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chndtr

from rig.arrays import Floats

BLUR_PX: Final = 0.62  #: of lens and pixel, typical; the size that is estimated with it absorbs a difference
_GRID = 0.04  # px, of the table of profiles
_SIZE_STEP = 0.03  # of the logarithm of the radius, likewise

Pixels = NDArray[np.float32]  #: (k, p) a number for each pixel of each window


def middle_size(radius: Floats) -> float:
    """Geometric mean of radii (n,)."""
    return float(np.exp(np.log(radius).mean())) if len(radius) else 1.0


class Profiles:
    """Profiles of blurred discs of several sizes about a middle one, as a table over distances and sizes."""

    def __init__(self, radius: Floats) -> None:
        self.middle = middle_size(radius)
        most = float(np.abs(np.log(radius / self.middle)).max(initial=0.0)) + 0.15
        self._half = int(np.ceil(most / _SIZE_STEP))
        sizes = self.middle * np.exp(np.arange(-self._half, self._half + 1) * _SIZE_STEP)
        self._length = int(np.ceil((sizes[-1] + 5 * BLUR_PX) / _GRID)) + 2
        rho = np.asarray(np.arange(self._length) * _GRID, float)
        # A blurred disc is the probability that a normally distributed shift leads into it: a noncentral chi-square.
        profile = np.stack([chndtr((size / BLUR_PX) ** 2, 2.0, (rho / BLUR_PX) ** 2) for size in sizes])
        by_size, by_rho = np.gradient(profile, _SIZE_STEP, _GRID)
        self._tables = [table.astype(np.float32).ravel() for table in (profile, by_rho, by_size)]

    def at(self, rho: Pixels, size: Floats) -> tuple[Pixels, Pixels, Pixels]:
        """Values and derivatives by distance and logarithm of the radius, at distances (k, p) for sizes (k,)."""
        row = np.clip(np.rint(size / _SIZE_STEP).astype(int) + self._half, 0, 2 * self._half)
        column = np.minimum(np.rint(rho * np.float32(1 / _GRID)), np.float32(self._length - 1))
        place = column.astype(np.int32) + (row * self._length).astype(np.int32)[:, None]
        value, by_rho, by_size = (table.take(place) for table in self._tables)
        value += by_rho * np.minimum(rho - column * np.float32(_GRID), np.float32(_GRID))
        value += by_size * (size - (row - self._half) * _SIZE_STEP).astype(np.float32)[:, None]
        return value, by_rho, by_size
