"""Rejects points and skis with too few images to check them, where the motion over time contradicts them.

Two images hardly contradict each other, whatever they show. There, and where a third one has next to no weight, the
motion is the only control (decision 0063).
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from analysis.pulses.gross_errors import RISK, Checked
from analysis.pulses.least_squares import Condition, Objects, adjust
from analysis.pulses.skis import SkiLines, across_axes
from photogrammetry.jumper.stick_model import by_slope_and_heading
from rig.arrays import Flags, Floats, Integers

_VARIANCE_GROWTH = (
    2.0**2
)  # growth of a variance without an image: with more, it is that image that tells where the object is
_UNCONTROLLED = 2  # images of a ski: three leave two observations over


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedPoints:
    """What the motion over time says of n points.

    Attributes:
        xyz: (n, 3) m; NaN where it says nothing.
        covariance: (n, 3, 3).
        doubted: (n, m) images that contradict it.
    """

    xyz: Floats
    covariance: Floats
    doubted: Flags


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedSkis:
    """What the motion over time says of n skis.

    Attributes:
        direction: (n, 3) unit vectors; NaN where it says nothing.
        covariance: (n, 2, 2) of slope and heading, rad^2.
    """

    direction: Floats
    covariance: Floats


def give_up_points(points: Objects, checked: Checked, calibration: Floats, expected: ExpectedPoints) -> Checked:
    """Reject points that contradict the motion, if no other image checks theirs.

    Nothing moves, and what several other images control stays as they have it, whatever the motion says.

    Args:
        points: n points.
        checked: from all images that are in order among themselves.
        calibration: (p, p) covariance of the cameras' uncertain parameters.
        expected: by the motion.
    """
    adjusted = checked.adjusted
    there = adjusted.ok & np.isfinite(expected.xyz).all(axis=1)
    rows = np.flatnonzero((checked.used & expected.doubted).any(axis=1) & there)
    if not len(rows):
        return checked
    off = (adjusted.state[rows] - expected.xyz[rows])[..., None]
    total = adjusted.covariance[rows] + expected.covariance[rows]
    chi_square = (off * np.linalg.solve(total, off)).sum(axis=(1, 2))
    without = adjust(points.subset(rows), calibration, checked.used[rows] & ~expected.doubted[rows])
    growth = np.linalg.eigvals(np.linalg.solve(adjusted.covariance[rows], without.covariance)).real.max(axis=1)
    lost = rows[(chi_square > special.chdtri(3, RISK)) & (~without.ok | (growth > _VARIANCE_GROWTH))]
    return _without(points, checked, lost)


def give_up_skis(skis: SkiLines, checked: Checked, expected: ExpectedSkis) -> Checked:
    """Reject skis of two images if their direction contradicts the motion; skis measured by hand stay.

    Args:
        skis: n skis.
        checked: from all images that are in order among themselves.
        expected: by the motion.
    """
    adjusted, used = checked.adjusted, checked.used
    alone = (used.sum(axis=1) <= _UNCONTROLLED) & ~(used & skis.by_hand).any(axis=1)
    rows = np.flatnonzero(adjusted.ok & alone & np.isfinite(expected.direction).all(axis=1))
    if not len(rows):
        return checked
    measured, other = adjusted.state[rows, 3:], expected.direction[rows]
    axes = np.stack(across_axes(measured), axis=1)
    # A line has no sense: which of its ends is the tip is told later.
    other = other * np.sign((measured * other).sum(axis=1, keepdims=True))
    off = (axes @ other[..., None])[..., 0]
    turns = axes @ by_slope_and_heading(other)
    total = adjusted.covariance[rows, 2:, 2:] + turns @ expected.covariance[rows] @ turns.swapaxes(1, 2)
    chi_square = (off[..., None] * np.linalg.solve(total, off[..., None])).sum(axis=(1, 2))
    return _without(skis, checked, rows[chi_square > special.chdtri(2, RISK)])


def _without(objects: Objects, checked: Checked, lost: Integers) -> Checked:
    """What was found, without some objects."""
    adjusted = checked.adjusted
    condition, used, removed = adjusted.condition.copy(), checked.used.copy(), checked.removed.copy()
    condition[lost] = Condition.UNCONTROLLED
    used[lost], removed[lost] = False, objects.seen[lost]
    return replace(checked, adjusted=replace(adjusted, condition=condition), used=used, removed=removed)
