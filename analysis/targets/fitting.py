"""Fits blurred patterns to grey values by least squares, many windows at a time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from rig.arrays import Flags, Floats

FIRST_BLUR: Final = 1.0  # px, to start from
_BLUR: Final = (0.3, 4.0)  # px, in which a window shows edges at all
_STEPS: Final = 25
_ENOUGH: Final = 1e-4  # px, of a step


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


def fitted(start: Floats, linearised: Callable[[Floats], tuple[Floats, Floats]]) -> Fit:
    """Fit by damped steps (Levenberg and Marquardt).

    Args:
        start: (n, u) start values of the unknowns: first x and y (px), last the logarithm of the blur's width (px).
        linearised: residuals (n, p), computed - observed, and derivatives (n, p, u) for unknowns (n, u).
    """
    unknowns = start.copy()
    count, size = unknowns.shape
    damping = np.full(count, 1e-3)
    residual, slopes = linearised(unknowns)
    cost = np.einsum("np,np->n", residual, residual)
    step = np.zeros_like(unknowns)
    for _ in range(_STEPS):
        normal = np.einsum("npi,npj->nij", slopes, slopes)
        diagonal = np.einsum("nii->ni", normal)
        damped = normal + (damping[:, None] * diagonal + 1e-9)[..., None] * np.eye(size)
        step = -np.linalg.solve(damped, np.einsum("npi,np->ni", slopes, residual)[..., None])[..., 0]
        tried = unknowns + step
        tried[:, -1] = np.clip(tried[:, -1], *np.log(_BLUR))
        next_residual, next_slopes = linearised(tried)
        next_cost = np.einsum("np,np->n", next_residual, next_residual)
        better = next_cost <= cost
        unknowns[better], residual[better], slopes[better] = tried[better], next_residual[better], next_slopes[better]
        cost = np.where(better, next_cost, cost)
        damping = np.where(better, damping / 5.0, np.minimum(damping * 5.0, 1e6))
        if np.all(np.abs(step[:, :2]).max(axis=1) < _ENOUGH):
            break
    cofactor = np.linalg.pinv(np.einsum("npi,npj->nij", slopes, slopes), hermitian=True)
    settled = np.abs(step[:, :2]).max(axis=1, initial=0.0) < 10.0 * _ENOUGH
    return Fit(unknowns, cost, np.stack((cofactor[:, 0, 0], cofactor[:, 1, 1]), axis=1), settled)
