"""Principal distance from vanishing points of directions at right angles: appendix B.

The constraint u^T K^-T K^-1 v = 0 (B1) gives c^2 = -(u1 v1 + u2 v2) / (u3 v3); the paper's last equation prints it
without the minus sign. Image coordinates are reduced to the principal point, in the metric frame.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.ideal_camera import Array
from rig.errors import BadInputError

_UNDETERMINED = 1e-6  # relative to the image: vanishing points that far away say nothing about c


def line_through(xy: ArrayLike) -> Array:
    """Homogeneous line (3,) with unit normal through image points (n, 2), by least squares of the distances."""
    xy = np.asarray(xy, float)
    centroid = xy.mean(axis=0)
    normal = np.linalg.svd(xy - centroid)[2][-1]
    return np.array([*normal, -normal @ centroid])


def vanishing_point(lines: ArrayLike) -> Array:
    """Common point (3,), homogeneous, norm 1, of the images (n, 3) of parallel lines; two of them: the cross product.

    Raises:
        BadInputError: fewer than two different lines.
    """
    lines = np.asarray(lines, float)
    scale = max(float(np.abs(lines[:, 2]).max()), 1.0)
    _, values, vectors = np.linalg.svd(lines / (1.0, 1.0, scale))
    if len(lines) < 2 or values[1] < 1e-12 * values[0]:
        raise BadInputError("a vanishing point has fewer than two different lines: give images of two parallel lines")
    point = vectors[-1] / (1.0, 1.0, scale)
    return np.asarray(point / np.linalg.norm(point))


def principal_distance(u: ArrayLike, v: ArrayLike) -> float:
    """Principal distance from vanishing points u, v (3,) of two directions at right angles.

    Raises:
        BadInputError: the points do not belong to such directions, or one of them is at infinity (the camera's axis is
            at right angles to that direction, and the image says nothing about c).
    """
    return principal_distance_from([(np.asarray(u, float), np.asarray(v, float))])


def principal_distance_from(pairs: Iterable[tuple[Array, Array]], homographies: Iterable[Array] = ()) -> float:
    """Principal distance from all that one camera has seen, by least squares in 1 / c^2.

    Args:
        pairs: homogeneous vanishing points of directions at right angles, any number of pairs.
        homographies: H (3, 3) of planes with two axes of equal scale at right angles: the first two columns are
            vanishing points of the axes, and their lengths in space are equal: two constraints each.

    Returns:
        c, image unit.

    Raises:
        BadInputError: nothing in the images determines c, or what does contradicts a pinhole.
    """
    rows = []
    for u, v in pairs:
        rows.append(_normalised(float(u[:2] @ v[:2]), float(u[2] * v[2]), u, v))
    for matrix in homographies:
        h, k, _ = matrix.T
        rows.append(_normalised(float(h[:2] @ k[:2]), float(h[2] * k[2]), h, k))
        rows.append(_normalised(float(h[:2] @ h[:2] - k[:2] @ k[:2]), float(h[2] ** 2 - k[2] ** 2), h, k))
    p, q = np.array(rows).reshape(-1, 2).T
    size = float(np.sqrt(p @ p))
    if not size > 0 or not np.sqrt(q @ q) > 0:
        raise BadInputError("no vanishing point determines the principal distance: take an oblique image")
    inverse_square = -(p @ q) / (p @ p)
    if not inverse_square > _UNDETERMINED**2:
        raise BadInputError("the vanishing points fit no principal distance: check the lines, or take an oblique image")
    return float(1 / np.sqrt(inverse_square))


def _normalised(p: float, q: float, u: Array, v: Array) -> tuple[float, float]:
    """The constraint p / c^2 + q = 0, scaled by the lengths of both points in the image."""
    size = float(np.hypot(*u[:2]) * np.hypot(*v[:2])) or 1.0
    return p / size, q / size
