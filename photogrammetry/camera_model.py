"""The camera: collinearity equations (A1) with interior orientation, and their analytic derivatives.

Coordinates are metric: x right, y up, origin at the image centre (contract of `svev-network/1`). Parameters stand
in the order of `INTERIOR` along the last axis. With k = R^T (X - X0) the ideal image point is

    xs = -c k1 / k3,  ys = -c k2 / k3.

Distortion d(q) acts either on the projected side, x = x0 + xs + d(xs), or on the measured side,
(x - x0) - d(x - x0) = xs. Both give one residual, in the image unit,

    v = xs + d(q) + x0 - x,   q = xs (projected)  or  q = x - x0 (measured).

All functions are vectorised over observations and broadcast, and keep complex numbers (for checks by complex steps).
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Order of the interior orientation's parameters (Luhmann et al. 2006).
INTERIOR = ("c", "x0", "y0", "a1", "a2", "a3", "b1", "b2", "c1", "c2")

#: Floats; complex ones pass through.
Array = NDArray[Any]

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

    interior: Array
    balance: Array
    measured: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Linearised:
    """Residuals and their derivatives.

    Attributes:
        v: (n, 2), computed - observed.
        by_interior: (n, 2, 10).
        by_pose: (n, 2, 6): X0, Y0, Z0, then increments about the camera's own axes (rad).
        by_point: (n, 2, 3).
    """

    v: Array
    by_interior: Array
    by_pose: Array
    by_point: Array


def camera_coordinates(rotation: Array, position: Array, xyz: Array) -> Array:
    """Object points in the camera system, k = R^T (X - X0); visible points have k3 < 0.

    Args:
        rotation: (..., 3, 3).
        position: (..., 3), projection centres.
        xyz: (..., 3).

    Returns:
        (..., 3).
    """
    k: Array = np.einsum("...ji,...j->...i", rotation, xyz - position)
    return k


def ideal_point(c: Array, k: Array) -> Array:
    """Equation (A1) for camera coordinates k (..., 3) and principal distance c (...): (..., 2)."""
    return -np.asarray(c)[..., None] * k[..., :2] / k[..., 2:3]


def distortion(lens: Lens, q: Array) -> Array:
    """d(q): radial, decentring, affinity and shear.

    Args:
        lens: interior orientation.
        q: (..., 2), coordinates reduced to the principal point.

    Returns:
        (..., 2), image unit.
    """
    shifts: Array = np.einsum("...rk,...k->...r", _terms(lens, q), lens.interior[..., 3:])
    return shifts


def image_point(lens: Lens, rotation: Array, position: Array, xyz: Array) -> Array:
    """Where a point is seen: the measured image coordinates without error.

    Args:
        lens: interior orientation.
        rotation: (..., 3, 3).
        position: (..., 3).
        xyz: (..., 3), object points.

    Returns:
        (..., 2), metric image coordinates.
    """
    return distort(lens, ideal_point(lens.interior[..., 0], camera_coordinates(rotation, position, xyz)))


def distort(lens: Lens, ideal: Array) -> Array:
    """Measured coordinates of ideal points.

    Args:
        lens: interior orientation.
        ideal: (..., 2), (xs, ys).

    Returns:
        (..., 2). Where the distortion has no inverse there, NaN.
    """
    principal = lens.interior[..., 1:3]
    forward = ideal + distortion(lens, ideal)
    if not np.any(lens.measured):
        return np.asarray(principal + forward)
    inverse = _solve(lens, ideal, sign=-1.0)
    measured: Array = principal + np.where(np.asarray(lens.measured)[..., None], inverse, forward)
    return measured


def undistort(lens: Lens, xy: Array) -> Array:
    """Ideal coordinates of measured points, the inverse of `distort`.

    Args:
        lens: interior orientation.
        xy: (..., 2), measured metric image coordinates.

    Returns:
        (..., 2), (xs, ys). Where the distortion has no inverse there, NaN.
    """
    reduced = xy - lens.interior[..., 1:3]
    direct = reduced - distortion(lens, reduced)
    if np.all(lens.measured):
        return direct
    inverse = _solve(lens, reduced, sign=1.0)
    ideal: Array = np.where(np.asarray(lens.measured)[..., None], direct, inverse)
    return ideal


def residuals(lens: Lens, rotation: Array, position: Array, xyz: Array, xy: Array) -> Array:
    """Residuals v = computed - observed, (n, 2); arguments as in `linearise`."""
    ideal = ideal_point(lens.interior[..., 0], camera_coordinates(rotation, position, xyz))
    reduced = xy - lens.interior[..., 1:3]
    q = np.where(lens.measured[..., None], reduced, ideal)
    v: Array = ideal + distortion(lens, q) - reduced
    return v


def linearise(lens: Lens, rotation: Array, position: Array, xyz: Array, xy: Array) -> Linearised:
    """Residuals and analytic derivatives of the collinearity equations.

    Args:
        lens: n interior orientations.
        rotation: (n, 3, 3).
        position: (n, 3).
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

    slope = _slope(lens, q)
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
    by_pose[..., 3:] = np.cross(by_k, k[..., None, :])
    return Linearised(v, by_interior, by_pose, by_point)


def _terms(lens: Lens, q: Array) -> Array:
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


def _slope(lens: Lens, q: Array) -> Array:
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


def _solve(lens: Lens, target: Array, sign: float) -> Array:
    """Newton's solution of q + sign d(q) = target; NaN where there is none on the branch that holds the centre."""
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
    solved: Array = np.where(right[..., None], q, np.nan)
    return solved


def _jacobian(lens: Lens, q: Array, sign: float) -> tuple[Array, Array]:
    """Derivative of q + sign d(q), and its determinant."""
    matrix = np.eye(2) + sign * _slope(lens, q)
    return matrix, matrix[..., 0, 0] * matrix[..., 1, 1] - matrix[..., 0, 1] * matrix[..., 1, 0]
