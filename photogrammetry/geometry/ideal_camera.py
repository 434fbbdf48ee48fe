"""The ideal camera of the paper's appendix A: a pinhole without distortion (Eq. A1).

All closed solutions (intersection, resection, relative orientation, DLT) take this camera. Their image coordinates are
reduced: metric frame (x right, y up), principal point and distortion subtracted.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rig.arrays import Flags, Floats


@dataclass(frozen=True, slots=True)
class IdealCamera:
    """Principal distance and pose.

    Attributes:
        c: principal distance, image unit, positive.
        X0: (3,) projection centre, object unit.
        R: (3, 3) rotation; its columns r1, r2, r3 are the camera's axes in the object system (Eq. A1).
    """

    c: float
    X0: Floats
    R: Floats

    def project(self, points: ArrayLike) -> Floats:
        """Image coordinates by Eq. A1.

        Args:
            points: (..., 3) object coordinates.

        Returns:
            (..., 2) image coordinates; not finite for a point in the plane of the projection centre.
        """
        d = (np.asarray(points, float) - self.X0) @ self.R
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(-self.c * d[..., :2] / d[..., 2:])

    def in_front(self, points: ArrayLike) -> Flags:
        """Whether the points (..., 3) lie before the camera, which looks along -r3."""
        return np.asarray((np.asarray(points, float) - self.X0) @ self.R[:, 2] < 0)

    def rays(self, xy: ArrayLike) -> Floats:
        """Unit vectors (..., 3) in the object system from the projection centre to the image points (..., 2)."""
        return unit_rays(xy, self.c) @ self.R.T

    def matrix(self) -> Floats:
        """The (3, 4) projection matrix P = K R^T (I, -X0) of Eq. A2b, with K = diag(-c, -c, 1)."""
        rotated = np.diag((-self.c, -self.c, 1.0)) @ self.R.T
        return np.column_stack((rotated, -rotated @ self.X0))


def unit_rays(xy: ArrayLike, c: float) -> Floats:
    """Unit vectors (..., 3) in the camera system towards the object: (x, y, -c) normalised."""
    xy = np.asarray(xy, float)
    rays = np.concatenate((xy, np.full((*xy.shape[:-1], 1), -c)), axis=-1)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))
