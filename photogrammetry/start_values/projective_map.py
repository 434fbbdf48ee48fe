"""Linear projective maps into an image: the homogeneous least-squares solution that plane and space have in common."""

import numpy as np

from photogrammetry.ideal_camera import Array


def homogeneous(points: Array) -> Array:
    """Points (n, d) with a 1 appended."""
    return np.column_stack((points, np.ones(len(points))))


def fit_projective(points: Array, xy: Array) -> tuple[Array, Array]:
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


def _normalising(points: Array) -> Array:
    """Matrix (d + 1, d + 1) that brings points (n, d) to centroid 0 and root mean square distance sqrt(d)."""
    n, d = points.shape
    centroid = points.mean(axis=0)
    spread = np.sqrt(((points - centroid) ** 2).sum() / n)
    scale = np.sqrt(d) / spread if spread > 0 else 1.0
    matrix = np.diag([*[scale] * d, 1.0])
    matrix[:d, d] = -scale * centroid
    return matrix
