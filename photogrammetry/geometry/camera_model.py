"""Camera model: where an object point appears in an image (equation A1 with distortion), and the derivatives.

Coordinates are metric: x right, y up, origin at the image centre (contract of `svev-network/1`). Parameters stand
in the order of `INTERIOR` along the last axis. With k = R^T (X - X0) the ideal image point is

    xs = -c k1 / k3,  ys = -c k2 / k3.

Distortion d(q) acts either on the projected side, x = x0 + xs + d(xs), or on the measured side,
(x - x0) - d(x - x0) = xs. Both give one residual, in the image unit,

    v = xs + d(q) + x0 - x,   q = xs (projected)  or  q = x - x0 (measured).

All functions take arrays of observations, which broadcast, and pass complex numbers through (checks by complex steps).
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from photogrammetry.geometry.rotation import skew
from rig.arrays import Flags, Numbers

#: Order of the interior orientation's parameters (Luhmann et al. 2006).
INTERIOR = ("c", "x0", "y0", "a1", "a2", "a3", "b1", "b2", "c1", "c2")

_NEWTON_STEPS = 30
_NEWTON_ENOUGH = 1e-13  # relative to c


class Distortion(StrEnum):
    """The side that the distortion acts on."""

    PROJECTED = "projected"
    MEASURED = "measured"


@dataclass(frozen=True, slots=True, eq=False)
class Lens:
    """Interior orientations, one per observation (or one that all share, by broadcasting).

    Attributes:
        interior: (..., 10), in the order of `INTERIOR`.
        balance: (...), the radius r0 at which the radial distortion is balanced; 0: unbalanced.
        measured: (...), True where the distortion acts on the measured side.
    """

    interior: Numbers
    balance: Numbers
    measured: Flags


@dataclass(frozen=True, slots=True, eq=False)
class Linearised:
    """Residuals and their derivatives.

    Attributes:
        v: (n, 2), computed - observed.
        by_interior: (n, 2, 10).
        by_pose: (n, 2, 6): X0, Y0, Z0, then increments about the camera's own axes (rad).
        by_point: (n, 2, 3).
    """

    v: Numbers
    by_interior: Numbers
    by_pose: Numbers
    by_point: Numbers


def camera_coordinates(rotation: Numbers, position: Numbers, xyz: Numbers) -> Numbers:
    """Object points xyz in the camera system, k = R^T (X - X0), all (..., 3); visible points have k3 < 0."""
    k: Numbers = np.einsum("...ji,...j->...i", rotation, xyz - position)
    return k


def ideal_point(c: Numbers, k: Numbers) -> Numbers:
    """Equation (A1) for camera coordinates k (..., 3) and principal distance c (...): (..., 2)."""
    return -np.asarray(c)[..., None] * k[..., :2] / k[..., 2:3]


def distortion(lens: Lens, q: Numbers) -> Numbers:
    """d(q) (..., 2), image unit: radial, decentring, affinity, shear; q (..., 2) is reduced to the principal point."""
    x, y = q[..., 0], q[..., 1]
    a1, a2, a3, b1, b2, c1, c2 = (lens.interior[..., i] for i in range(3, len(INTERIOR)))
    r2, p2 = x * x + y * y, lens.balance**2
    radial = a1 * (r2 - p2) + a2 * (r2 * r2 - p2 * p2) + a3 * (r2 * r2 * r2 - p2 * p2 * p2)
    along_x = x * radial + b1 * (r2 + 2.0 * x * x) + 2.0 * b2 * x * y + c1 * x + c2 * y
    along_y = y * radial + b2 * (r2 + 2.0 * y * y) + 2.0 * b1 * x * y
    return np.stack((along_x, along_y), axis=-1)


def image_point(lens: Lens, rotation: Numbers, position: Numbers, xyz: Numbers) -> Numbers:
    """Image coordinates (..., 2) of object points xyz (..., 3), as measured without error; metric frame."""
    return distort(lens, ideal_point(lens.interior[..., 0], camera_coordinates(rotation, position, xyz)))


def distort(lens: Lens, ideal: Numbers) -> Numbers:
    """Image coordinates (..., 2) of ideal points (xs, ys), with distortion and principal point.

    NaN where the distortion has no inverse.
    """
    principal = lens.interior[..., 1:3]
    forward = ideal + distortion(lens, ideal)
    if not np.any(lens.measured):
        return np.asarray(principal + forward)
    inverse = _solve(lens, ideal, sign=-1.0)
    measured: Numbers = principal + np.where(np.asarray(lens.measured)[..., None], inverse, forward)
    return measured


def undistort(lens: Lens, xy: Numbers) -> Numbers:
    """Ideal points (xs, ys) of measured metric image coordinates xy (..., 2), the inverse of `distort`.

    NaN where the distortion has no inverse.
    """
    reduced = xy - lens.interior[..., 1:3]
    direct = reduced - distortion(lens, reduced)
    if np.all(lens.measured):
        return direct
    inverse = _solve(lens, reduced, sign=1.0)
    ideal: Numbers = np.where(np.asarray(lens.measured)[..., None], direct, inverse)
    return ideal


def residuals(lens: Lens, rotation: Numbers, position: Numbers, xyz: Numbers, xy: Numbers) -> Numbers:
    """Residuals v = computed - observed, (n, 2); arguments as in `linearise`."""
    ideal = ideal_point(lens.interior[..., 0], camera_coordinates(rotation, position, xyz))
    reduced = xy - lens.interior[..., 1:3]
    q = np.where(lens.measured[..., None], reduced, ideal)
    v: Numbers = ideal + distortion(lens, q) - reduced
    return v


def linearise(lens: Lens, rotation: Numbers, position: Numbers, xyz: Numbers, xy: Numbers) -> Linearised:
    """Residuals and analytic derivatives of the collinearity equations.

    Args:
        lens: n interior orientations; or one, of shape (1, ...), the same for all.
        rotation: (n, 3, 3) or (1, 3, 3).
        position: (n, 3) or (1, 3).
        xyz: (n, 3), object points.
        xy: (n, 2), measured metric image coordinates.

    Returns:
        Residuals and their derivatives.
    """
    interior, measured = lens.interior, lens.measured[..., None]
    k = camera_coordinates(rotation, position, xyz)
    ideal = ideal_point(interior[..., 0], k)
    reduced = xy - interior[..., 1:3]
    q = np.where(measured, reduced, ideal)
    terms = _terms(lens, q)
    v = ideal + np.einsum("nrk,nk->nr", terms, interior[..., 3:]) - reduced

    slope = distortion_slope(lens, q)
    unit = np.eye(2)
    by_ideal = np.where(measured[..., None], 0.0, slope) + unit
    by_k = np.zeros((*k.shape[:-1], 2, 3), dtype=v.dtype)
    by_k[..., 0, 0] = by_k[..., 1, 1] = -interior[..., 0] / k[..., 2]
    by_k[..., 2] = -ideal / k[..., 2:3]
    by_k = by_ideal @ by_k

    by_interior = np.empty((*v.shape, len(INTERIOR)), dtype=v.dtype)
    by_interior[..., 0] = np.einsum("nrs,ns->nr", by_ideal, ideal / interior[..., :1])
    by_interior[..., 1:3] = unit - np.where(measured[..., None], slope, 0.0)
    by_interior[..., 3:] = terms
    by_point = by_k @ np.swapaxes(rotation, -1, -2)
    by_pose = np.empty((*v.shape, 6), dtype=v.dtype)
    by_pose[..., :3] = -by_point
    # dk/dd = [k]x for R' = R exp([d]x)
    by_pose[..., 3:] = by_k @ skew(k)
    return Linearised(v, by_interior, by_pose, by_point)


def _terms(lens: Lens, q: Numbers) -> Numbers:
    """Derivatives of d(q) by a1, a2, a3, b1, b2, c1, c2: (..., 2, 7)."""
    x, y = q[..., 0], q[..., 1]
    r2, b2 = x * x + y * y, lens.balance**2
    terms = np.zeros((*np.broadcast_shapes(x.shape, np.shape(b2)), 2, 7), dtype=q.dtype)
    for degree in (1, 2, 3):
        radial = r2**degree - b2**degree
        terms[..., 0, degree - 1] = x * radial
        terms[..., 1, degree - 1] = y * radial
    terms[..., 0, 3] = r2 + 2.0 * x * x
    terms[..., 1, 3] = terms[..., 0, 4] = 2.0 * x * y
    terms[..., 1, 4] = r2 + 2.0 * y * y
    terms[..., 0, 5] = x
    terms[..., 0, 6] = y
    return terms


def distortion_slope(lens: Lens, q: Numbers) -> Numbers:
    """Derivative of d(q) by q: (..., 2, 2)."""
    x, y = q[..., 0], q[..., 1]
    a1, a2, a3, b1, b2, c1, c2 = (lens.interior[..., i] for i in range(3, len(INTERIOR)))
    r2, p2 = x * x + y * y, lens.balance**2
    radial = a1 * (r2 - p2) + a2 * (r2**2 - p2**2) + a3 * (r2**3 - p2**3)
    growth = 2.0 * (a1 + 2.0 * a2 * r2 + 3.0 * a3 * r2**2)
    mixed = x * y * growth + 2.0 * (b1 * y + b2 * x)
    slope = np.empty((*radial.shape, 2, 2), dtype=np.result_type(radial, q))
    slope[..., 0, 0] = radial + x * x * growth + 6.0 * b1 * x + 2.0 * b2 * y + c1
    slope[..., 1, 1] = radial + y * y * growth + 6.0 * b2 * y + 2.0 * b1 * x
    slope[..., 0, 1] = mixed + c2
    slope[..., 1, 0] = mixed
    return slope


def _solve(lens: Lens, target: Numbers, sign: float) -> Numbers:
    """Solve q + sign d(q) = target by Newton; NaN where no solution is on the branch through the image centre."""
    q = target.copy()
    enough = _NEWTON_ENOUGH * np.abs(lens.interior[..., 0])[..., None]
    with np.errstate(all="ignore"):
        for _ in range(_NEWTON_STEPS):
            wrong = q + sign * distortion(lens, q) - target
            if np.all(np.abs(wrong) <= enough):
                break
            matrix, determinant = _jacobian(lens, q, sign)
            step_x = matrix[..., 1, 1] * wrong[..., 0] - matrix[..., 0, 1] * wrong[..., 1]
            step_y = matrix[..., 0, 0] * wrong[..., 1] - matrix[..., 1, 0] * wrong[..., 0]
            q = q - np.stack([step_x, step_y], axis=-1) / determinant[..., None]
        wrong = q + sign * distortion(lens, q) - target
        matrix, determinant = _jacobian(lens, q, sign)
        upright = (determinant > 0.0) & (matrix[..., 0, 0] + matrix[..., 1, 1] > 0.0)
        right = np.all(np.abs(wrong) <= enough, axis=-1) & upright
    solved: Numbers = np.where(right[..., None], q, np.nan)
    return solved


def _jacobian(lens: Lens, q: Numbers, sign: float) -> tuple[Numbers, Numbers]:
    """Derivative of q + sign d(q), and its determinant."""
    matrix = np.eye(2) + sign * distortion_slope(lens, q)
    return matrix, matrix[..., 0, 0] * matrix[..., 1, 1] - matrix[..., 0, 1] * matrix[..., 1, 0]
