"""Central projection of object points into a camera's image: Eq. (A1) of the paper.

Conventions are those of the network file: the columns of R are r1, r2, r3; pixel frame x right, y down, (0, 0) = centre
of the top-left pixel; principal point = image centre; no distortion. The simulated world has its own projection and
shares no code with `photogrammetry`, so that it can judge what that computes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rig.arrays import Floats


@dataclass(frozen=True, slots=True)
class Projection:
    """A camera without distortion, with its place and orientation.

    Attributes:
        X0: projection centre, m, shape (3,).
        R: rotation, shape (3, 3); r1 points right, r2 up, r3 backwards, away from the scene.
        c: principal distance, px.
        width: columns of the image.
        height: rows of the image.
    """

    X0: Floats
    R: Floats
    c: float
    width: int
    height: int

    def pixels(self, points: ArrayLike) -> Floats:
        """Pixel coordinates (x, y) of object points by Eq. (A1); shape (..., 3) to (..., 2).

        The coordinates of points behind the camera mean nothing: check `distance`.
        """
        along = (np.asarray(points, float) - self.X0) @ self.R
        metric = -self.c * along[..., :2] / along[..., 2:]
        return np.stack(((self.width - 1) / 2 + metric[..., 0], (self.height - 1) / 2 - metric[..., 1]), axis=-1)

    def distance(self, points: ArrayLike) -> Floats:
        """Distance along the optical axis, m, positive in front of the camera; shape (..., 3) to (...)."""
        distance: Floats = -(np.asarray(points, float) - self.X0) @ self.R[:, 2]
        return distance

    def sees(self, pixels: ArrayLike, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether pixel coordinates, shape (..., 2), lie at least `margin` px inside the image."""
        x, y = np.moveaxis(np.asarray(pixels, float), -1, 0)
        right, bottom = self.width - 1 - margin, self.height - 1 - margin
        inside: NDArray[np.bool_] = (x >= margin) & (x <= right) & (y >= margin) & (y <= bottom)
        return inside
