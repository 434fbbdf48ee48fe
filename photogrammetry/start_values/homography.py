"""Projective map between a plane in space and an image, from four or more points."""

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.ideal_camera import Array
from rig.errors import BadInputError

_DEFECT = 1e-9  # relative singular value that counts as zero


def normalising(points: Array) -> Array:
    """Matrix (d + 1, d + 1) that brings points (n, d) to centroid 0 and root mean square distance sqrt(d)."""
    n, d = points.shape
    centroid = points.mean(axis=0)
    spread = np.sqrt(((points - centroid) ** 2).sum() / n)
    scale = np.sqrt(d) / spread if spread > 0 else 1.0
    matrix = np.diag([*[scale] * d, 1.0])
    matrix[:d, d] = -scale * centroid
    return matrix


def homogeneous(points: Array) -> Array:
    """Points (n, d) with a 1 appended."""
    return np.column_stack((points, np.ones(len(points))))


def plane_homography(plane: ArrayLike, xy: ArrayLike) -> Array:
    """Homography H (3, 3), norm 1: (x, y, 1) ~ H (s, t, 1).

    Args:
        plane: (n, 2) coordinates (s, t) in the plane, n >= 4, no three of four on a line.
        xy: (n, 2) image coordinates.

    Returns:
        H.

    Raises:
        BadInputError: fewer than four points, or points on a line.
    """
    plane, xy = np.asarray(plane, float), np.asarray(xy, float)
    if len(plane) < 4:
        raise BadInputError(f"a homography has {len(plane)} points: give at least four")
    source, target = normalising(plane), normalising(xy)
    p = homogeneous(plane) @ source.T
    q = homogeneous(xy) @ target.T
    zero = np.zeros_like(p)
    rows = np.concatenate((np.hstack((p, zero, -q[:, :1] * p)), np.hstack((zero, p, -q[:, 1:2] * p))))
    _, values, vectors = np.linalg.svd(rows)
    if values[7] < _DEFECT * values[0]:
        raise BadInputError("three of the four points of a homography lie on a line: give points that span the plane")
    matrix = np.linalg.solve(target, vectors[-1].reshape(3, 3) @ source)
    return np.asarray(matrix / np.linalg.norm(matrix))
