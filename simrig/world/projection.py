"""Central projection of object points into a camera's image: Eq. (A1) of the paper.

Conventions are those of the network file: the columns of R are r1, r2, r3; pixel frame x right, y down, (0, 0) = centre
of the top-left pixel; principal point = image centre; no distortion. The simulated world depends on nothing that
analyses images, so that it can serve as their judge.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Projection:
    """An ideal camera in its place.

    Attributes:
        X0: projection centre, m, shape (3,).
        R: rotation, shape (3, 3); r1 points right, r2 up, r3 backwards, away from the scene.
        c: principal distance, px.
        width: columns of the image.
        height: rows of the image.
    """

    X0: Array
    R: Array
    c: float
    width: int
    height: int

    def pixels(self, points: ArrayLike) -> Array:
        """Pixel coordinates (x, y) of object points by Eq. (A1); shape (..., 3) to (..., 2).

        Points behind the camera give coordinates that mean nothing: see `distance`.
        """
        along = (np.asarray(points, float) - self.X0) @ self.R
        metric = -self.c * along[..., :2] / along[..., 2:]
        return np.stack(((self.width - 1) / 2 + metric[..., 0], (self.height - 1) / 2 - metric[..., 1]), axis=-1)

    def distance(self, points: ArrayLike) -> Array:
        """Distance along the optical axis, m, positive in front of the camera; shape (..., 3) to (...)."""
        distance: Array = -(np.asarray(points, float) - self.X0) @ self.R[:, 2]
        return distance

    def sees(self, pixels: ArrayLike, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether pixel coordinates, shape (..., 2), lie at least `margin` px inside the image."""
        x, y = np.moveaxis(np.asarray(pixels, float), -1, 0)
        right, bottom = self.width - 1 - margin, self.height - 1 - margin
        inside: NDArray[np.bool_] = (x >= margin) & (x <= right) & (y >= margin) & (y <= bottom)
        return inside


def look_at(X0: ArrayLike, target: ArrayLike, roll_deg: float = 0.0) -> Array:  # noqa: N803
    """Rotation, shape (3, 3), of a camera at `X0` whose optical axis meets `target`.

    With `roll_deg` = 0 the rows of the image are horizontal; a positive roll turns the camera clockwise as seen from
    behind it. The optical axis must not be vertical.
    """
    back = np.asarray(X0, float) - np.asarray(target, float)
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    cos, sin = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
    return np.column_stack((cos * right - sin * up, sin * right + cos * up, back))
