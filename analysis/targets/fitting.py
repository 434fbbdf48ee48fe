"""Fits blurred patterns to grey values by least squares, many windows at a time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from rig.arrays import Flags, Floats, Integers

FIRST_BLUR: Final = 1.0  # px, to start from
_BLUR: Final = (0.3, 4.0)  # px, in which a window shows edges at all
_STEPS_MOST: Final = 25
_SETTLED_PX: Final = 1e-4  # px, of a step


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """n measured places.

    Attributes:
        xy: (n, 2) px, pixel frame: x right, y down, (0, 0) the centre of the top left pixel.
        cofactor: (n, 2) variance of x and y for grey values of variance 1.
        noise: (n,) rms of the grey values' residuals.
        contrast: (n,) half the difference of white and black, positive for the pattern that was looked for.
        blur: (n,) width s (px).
        reach: (n, 2, 2) px, pixel frame, how far the pattern was fitted; columns: along both edges of a corner, or
            spanning the ellipse of a disc.
        good: (n,) whether the fit converged within its window.
    """

    xy: Floats
    cofactor: Floats
    noise: Floats
    contrast: Floats
    blur: Floats
    reach: Floats
    good: Flags


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """n fits.

    Attributes:
        unknowns: (n, u) adjusted.
        cost: (n,) sum of squares of the residuals.
        cofactor: (n, 2) of the first two unknowns.
        settled: (n,) whether the first two have come to rest.
    """

    unknowns: Floats
    cost: Floats
    cofactor: Floats
    settled: Flags


def fitted(start: Floats, linearised: Callable[[Floats, Integers], tuple[Floats, Floats]]) -> Fit:
    """Fit by damped steps (Levenberg and Marquardt), each window until it has come to rest.

    Args:
        start: (n, u) start values of the unknowns: first x and y (px), last the logarithm of the blur's width (px).
        linearised: residuals (m, p), computed - observed, and derivatives (m, u, p) for unknowns (m, u) of the windows
            with these m indices.
    """
    unknowns = start.copy()
    count, size = unknowns.shape
    moving = np.arange(count)
    residual, slopes = linearised(unknowns, moving)
    cost = np.sum(residual**2, axis=1)
    normal = slopes @ slopes.swapaxes(1, 2)
    gradient = _times(slopes, residual)
    damping = np.full(count, 1e-3)
    moved = np.zeros(count)
    for _ in range(_STEPS_MOST):
        diagonal = np.einsum("nii->ni", normal[moving])
        damped = normal[moving] + (damping[moving, None] * diagonal + 1e-9)[..., None] * np.eye(size)
        step = -np.linalg.solve(damped, gradient[moving, :, None])[..., 0]
        moved[moving] = np.abs(step[:, :2]).max(axis=1)
        tried = unknowns[moving] + step
        tried[:, -1] = np.clip(tried[:, -1], *np.log(_BLUR))
        residual, slopes = linearised(tried, moving)
        tried_cost = np.sum(residual**2, axis=1)
        better = tried_cost <= cost[moving]
        damping[moving] = np.where(better, damping[moving] / 5.0, np.minimum(damping[moving] * 5.0, 1e6))
        found, slopes = moving[better], slopes[better]
        unknowns[found], cost[found] = tried[better], tried_cost[better]
        normal[found], gradient[found] = slopes @ slopes.swapaxes(1, 2), _times(slopes, residual[better])
        moving = moving[~better | (moved[moving] >= _SETTLED_PX)]
        if not len(moving):
            break
    cofactor = np.linalg.pinv(normal, hermitian=True)
    return Fit(unknowns, cost, np.stack((cofactor[:, 0, 0], cofactor[:, 1, 1]), axis=1), moved < 10.0 * _SETTLED_PX)


def _times(matrices: Floats, vectors: Floats) -> Floats:
    """(n, u) from (n, u, p) and (n, p)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])
