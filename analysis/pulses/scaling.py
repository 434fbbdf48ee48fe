"""Tests the standard deviations that came with the measurements against how well the images of a jump agree.

Skis bend, lenses are not quite what their calibration says, a person clicks worse than he thinks: if most points or
skis of a jump agree worse than their sigmas allow, it is the sigmas that are wrong, and not the images one by one.
"""

from collections.abc import Sequence
from typing import Protocol, TypeVar

import numpy as np
from scipy import special

from analysis.pulses.least_squares import Adjusted, Objects, adjust
from rig.arrays import Floats

#: Probability that right sigmas are held for too small.
RISK = 0.001
_LARGEST_PX = 1.0  # larger errors are mistakes, or cameras that are not synchronous, and no scatter
_MOST_STEPS = 8
_SETTLED_FACTOR = 1.02  # of the last step, where the share of the calibration keeps it from being exact

_Scalable = TypeVar("_Scalable", bound="Scalable")


class Scalable(Objects, Protocol):
    """Objects whose image measurement can be made less accurate."""

    def scaled(self: _Scalable, factor: float) -> _Scalable:
        """The same with all standard deviations of the image measurement times a factor."""

    def sigma(self) -> float:
        """Median standard deviation of the image measurement, px."""


def scaled_to_fit(
    objects: _Scalable, calibration: Floats, readings: Sequence[_Scalable] = ()
) -> tuple[_Scalable, Adjusted, float]:
    """Objects with sigmas that most of them agree with, and the factor by which the given sigmas were too small.

    The median of the tests decides, so that single mistakes do not count. Sigmas that are not significantly too small
    stay, and so do those that would exceed one pixel.

    Args:
        objects: all of a jump.
        calibration: (p, p) covariance of the cameras' uncertain parameters.
        readings: the same measurements with other names, if they might have them: what agrees under another name does
            not speak against the sigmas.

    Returns:
        The objects, adjusted, and the factor.
    """
    first = adjust(objects, calibration)
    if not _too_small(first):
        return objects, first, 1.0
    adjusted = [first, *(adjust(each, calibration) for each in readings)]
    if not all(map(_too_small, adjusted)):
        return objects, first, 1.0
    factor = 1.0
    for _ in range(_MOST_STEPS):
        ratios = _ratios(adjusted)
        step = float(np.sqrt(np.median(ratios))) if len(ratios) else np.inf
        factor *= step
        if factor * objects.sigma() > _LARGEST_PX:
            return objects, first, 1.0
        if step < _SETTLED_FACTOR:
            break
        adjusted = [adjust(each.scaled(factor), calibration) for each in (objects, *readings)]
    if factor <= 1:
        return objects, first, 1.0
    return (scaled := objects.scaled(factor)), adjust(scaled, calibration), factor


def _ratios(adjusted: Sequence[Adjusted]) -> Floats:
    """Chi-squares of controlled objects over their median if the sigmas are right; the least of all readings."""
    ratios = [
        np.where(
            np.isfinite(each.chi_square) & (each.redundancy > 0),
            each.chi_square / special.chdtri(np.maximum(each.redundancy, 1), 0.5),
            np.inf,
        )
        for each in adjusted
    ]
    least = np.min(ratios, axis=0)
    return np.asarray(least[np.isfinite(least)])


def _too_small(adjusted: Adjusted) -> bool:
    """Whether the median probability of the residuals is smaller than chance allows.

    Errors of the calibration are common to all objects. The correlation of two chi-squares is at most the square of
    their share, and that leaves so many independent ones.
    """
    tested = np.isfinite(adjusted.chi_square) & (adjusted.redundancy > 0)
    if not tested.any():
        return False
    common = float(np.median(adjusted.calibration_share[tested])) ** 2
    independent = 1 / (common + (1 - common) / tested.sum())
    probability = np.median(special.chdtrc(adjusted.redundancy[tested], adjusted.chi_square[tested]))
    least = 0.5 - 0.5 * float(special.ndtri(1 - RISK)) / np.sqrt(independent)
    return bool(probability < max(least, RISK))
