"""Space resection with unknown interior orientation: direct linear transformation, homogeneous solution (section 1)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.ideal_camera import Array, IdealCamera
from photogrammetry.start_values.projective_map import fit_projective, homogeneous
from rig.errors import BadInputError

_COPLANAR = 1e-7  # relative singular value: the system has a second solution


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
    principal_point: Array
    aspect: float
    shear: float
    matrix: Array
    residuals: Array


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


def _decompose(matrix: Array, points: Array, xy: Array) -> Dlt:
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
