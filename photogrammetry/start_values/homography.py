"""Projective map between a plane in space and an image, from four or more points."""

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.ideal_camera import Array
from photogrammetry.start_values.projective_map import fit_projective
from rig.errors import BadInputError

_DEFECT = 1e-9  # relative singular value that counts as zero


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
    matrix, values = fit_projective(plane, xy)
    if values[7] < _DEFECT * values[0]:
        raise BadInputError("three of the four points of a homography lie on a line: give points that span the plane")
    return matrix
