"""Linear maps into an image, without start values: homography of a plane, direct linear transformation of space."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.geometry.ideal_camera import IdealCamera
from rig.arrays import Floats
from rig.errors import BadInputError

_DEFECT = 1e-9  # relative singular value that counts as zero
_COPLANAR = 1e-7  # relative singular value: the system has a second solution


def homogeneous(points: Floats) -> Floats:
    """Points (n, d) with a 1 appended."""
    return np.column_stack((points, np.ones(len(points))))


def fit_projective(points: Floats, xy: Floats) -> tuple[Floats, Floats]:
    """Fit (x, y, 1) ~ M (p, 1), in normalised coordinates so that the solution does not depend on units.

    Args:
        points: (n, d) coordinates in a plane or in space.
        xy: (n, 2) image coordinates.

    Returns:
        M (3, d + 1), norm 1, and the singular values (3 d + 3,) of the system, the largest first: a second small one
        leaves M open.
    """
    source, target = _normalising(points), _normalising(xy)
    p = homogeneous(points) @ source.T
    q = homogeneous(xy) @ target.T
    zero = np.zeros_like(p)
    rows = np.concatenate((np.hstack((p, zero, -q[:, :1] * p)), np.hstack((zero, p, -q[:, 1:2] * p))))
    _, values, vectors = np.linalg.svd(rows)
    matrix = np.linalg.solve(target, vectors[-1].reshape(3, -1) @ source)
    return np.asarray(matrix / np.linalg.norm(matrix)), np.asarray(values)


def _normalising(points: Floats) -> Floats:
    """Matrix (d + 1, d + 1) that brings points (n, d) to centroid 0 and root mean square distance sqrt(d)."""
    n, d = points.shape
    centroid = points.mean(axis=0)
    spread = np.sqrt(((points - centroid) ** 2).sum() / n)
    scale = np.sqrt(d) / spread if spread > 0 else 1.0
    matrix = np.diag([*[scale] * d, 1.0])
    matrix[:d, d] = -scale * centroid
    return matrix


def plane_homography(plane: ArrayLike, xy: ArrayLike) -> Floats:
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
    matrix, values = fit_projective(plane, xy)
    if values[7] < _DEFECT * values[0]:
        raise BadInputError("three of the four points of a homography lie on a line: give points that span the plane")
    return matrix


@dataclass(frozen=True, slots=True)
class Dlt:
    """Result of a direct linear transformation.

    Attributes:
        camera: principal distance (geometric mean of both axes) and pose in the convention of Eq. A1.
        principal_point: (2,) x0, y0.
        aspect: ratio of the principal distances along x and y.
        shear: rate of change of x with y.
        matrix: (3, 4) projection matrix P, (x, y, 1) ~ P (X, Y, Z, 1), norm 1.
        residuals: (n, 2) computed - observed.
    """

    camera: IdealCamera
    principal_point: Floats
    aspect: float
    shear: float
    matrix: Floats
    residuals: Floats


def resect_dlt(points: ArrayLike, xy: ArrayLike) -> Dlt:
    """Pose and interior orientation of one image from at least six known points.

    Args:
        points: (n, 3) object coordinates, n >= 6, not in a plane.
        xy: (n, 2) metric image coordinates.

    Returns:
        The decomposed projection matrix.

    Raises:
        BadInputError: fewer than six points, or points (nearly) in a plane or on another surface that leaves it open.
    """
    points, xy = np.asarray(points, float), np.asarray(xy, float)
    if len(points) < 6:
        raise BadInputError(f"a direct linear transformation has {len(points)} points: give at least six")
    matrix, values = fit_projective(points, xy)
    extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if values[10] < _COPLANAR * values[0] or extents[2] < _COPLANAR * extents[0]:
        raise BadInputError("the points of a direct linear transformation lie in a plane: add points beside it")
    return _decompose(matrix, points, xy)


def _decompose(matrix: Floats, points: Floats, xy: Floats) -> Dlt:
    """P = k K R^T (I, -X0), K = ((-cx, s, x0), (0, -cy, y0), (0, 0, 1)); visible points lie at negative depth."""
    left = matrix[:, :3]
    if np.median(homogeneous(points) @ matrix[2]) > 0:
        matrix, left = -matrix, -left
    # RQ factors from the QR factors of the reversed matrix
    q, r = np.linalg.qr(left[::-1].T)
    upper, rows = r.T[::-1, ::-1], q.T[::-1]
    signs = np.sign(np.diag(upper)) * (-1.0, -1.0, 1.0)
    upper, rows = upper * signs, signs[:, None] * rows
    if np.linalg.det(rows) < 0:
        raise BadInputError("the projection matrix is that of a mirror image: check the sense of the image coordinates")
    k = upper / upper[2, 2]
    cx, cy = -k[0, 0], -k[1, 1]
    centre = np.asarray(-np.linalg.solve(left, matrix[:, 3]), float)
    camera = IdealCamera(float(np.sqrt(cx * cy)), centre, rows.T)
    image = homogeneous(points) @ matrix.T
    residuals = image[:, :2] / image[:, 2:] - xy
    return Dlt(camera, k[:2, 2].copy(), float(cx / cy), float(-k[0, 1] / cy), matrix, residuals)
