"""Median and quantiles of one array: what NumPy's gives, without its overhead, which is most of the time for few."""

import numpy as np

from analysis.scene.static_image import GreyImage
from rig.arrays import Floats


def median(values: Floats | GreyImage) -> float:
    """The median of all values, one at least, none of them NaN."""
    flat = values.ravel()
    middle = len(flat) // 2
    if len(flat) % 2:
        return float(np.partition(flat, middle)[middle])
    parted = np.partition(flat, (middle - 1, middle))
    return float((parted[middle - 1] + parted[middle]) / 2)


def quantile(values: Floats | GreyImage, share: float) -> float:
    """The value below which such a share of all values lies, interpolated as `np.quantile` does."""
    flat = np.sort(values, axis=None)
    place = share * (len(flat) - 1)
    below = int(place)
    return float(flat[below] + (place - below) * (flat[min(below + 1, len(flat) - 1)] - flat[below]))
