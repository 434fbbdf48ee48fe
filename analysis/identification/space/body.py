"""What a jumper looks like in space, loosely: enough to tell which is which, too little to measure anything by it.

The frame is that of `flights.Flight`: x horizontal along it, y to the left, z up. All numbers are sizes of people.
"""

from typing import Final

import numpy as np

from analysis.measurements.model import POINTS
from rig.arrays import Floats

#: Means and standard deviations of differences of points, m, from the crouch on the table to the flight.
_DIFFERENCES: Final = {
    ("P2", "P1"): ((0.60, 0.00, 0.25), (0.20, 0.12, 0.25)),
    ("P3", "P4"): ((0.00, 0.45, 0.00), (0.12, 0.12, 0.10)),
    ("P3", "P2"): ((0.25, 0.22, 0.60), (0.30, 0.18, 0.17)),
    ("P4", "P2"): ((0.25, -0.22, 0.60), (0.30, 0.18, 0.17)),
    ("P3", "P1"): ((0.90, 0.22, 0.80), (0.35, 0.20, 0.28)),
    ("P4", "P1"): ((0.90, -0.22, 0.80), (0.35, 0.20, 0.28)),
}
#: Means and standard deviations of distances, m.
_DISTANCES: Final = {
    ("P2", "P1"): (0.70, 0.10),
    ("P3", "P4"): (0.48, 0.13),
    ("P3", "P2"): (0.75, 0.16),
    ("P4", "P2"): (0.75, 0.16),
    ("P3", "P1"): (1.30, 0.27),
    ("P4", "P1"): (1.30, 0.27),
}
#: Indices of P3 and P4 in `POINTS`.
BINDINGS: Final = [2, 3]
#: Index of P2 in `POINTS`.
HIP: Final = [1]
#: Implausibility that nine in ten pairs of points of bodies stay below: chi-square, 4 degrees of freedom.
USUAL = 7.8
#: A jumper with skis is not longer than this, m.
REACH_M = 2.5


def implausibility(one: int, other: int, difference: Floats) -> Floats:
    """How badly differences other - one fit two points of the body: about chi-square with four degrees of freedom.

    Args:
        one: index into `POINTS`.
        other: likewise.
        difference: (n, 3) m, in the frame of the flight.

    Returns:
        (n,) squared deviations from the means.
    """
    names = POINTS[one], POINTS[other]
    if names not in _DIFFERENCES:
        return implausibility(other, one, -difference)
    mean, sigma = usual_difference(one, other)
    length, spread = _DISTANCES[names]
    apart = (np.linalg.norm(difference, axis=1) - length) / spread
    return np.asarray((((difference - mean) / sigma) ** 2).sum(axis=1) + apart**2)


def usual_difference(one: int, other: int) -> tuple[Floats, Floats]:
    """Mean and standard deviation (3,) of the difference other - one of two points, m, in the frame of the flight.

    Args:
        one: index into `POINTS`.
        other: likewise.
    """
    names = POINTS[one], POINTS[other]
    if names not in _DIFFERENCES:
        mean, sigma = usual_difference(other, one)
        return -mean, sigma
    mean, sigma = (np.array(values) for values in _DIFFERENCES[names])
    return mean, sigma


def log_spread(one: int, other: int) -> float:
    """Logarithm of the product of the variances in `implausibility`: the more freely two points lie, the larger.

    Where a point may be either of two things, this belongs to the squared deviations: -2 ln of the likelihood.

    Args:
        one: index into `POINTS`.
        other: likewise.
    """
    names = POINTS[one], POINTS[other]
    key = names if names in _DIFFERENCES else names[::-1]
    return 2.0 * float(np.log((*_DIFFERENCES[key][1], _DISTANCES[key][1])).sum())
