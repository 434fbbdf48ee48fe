"""Central projection of object points into a camera's image: Eq. (A1) of the paper.

Conventions are those of the network file: the columns of R are r1, r2, r3; pixel frame x right, y down, (0, 0) = centre
of the top-left pixel; distortion acts on the projected side. The simulated world has its own projection and no code in
common with `photogrammetry`, so that it can judge its results.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rig.arrays import Floats


@dataclass(frozen=True, slots=True)
class Lens:
    """Principal point and distortion (Luhmann et al. 2006); metric frame: x right, y up, px.

    Attributes:
        x0: principal point, px from the image centre.
        y0: likewise, upwards.
        a1: radial distortion, px^-2; a2, px^-4; a3, px^-6.
        a2: see `a1`.
        a3: see `a1`.
        r0: radius at which the radial distortion is balanced, px; 0: unbalanced.
        b1: decentring, px^-1.
        b2: decentring, px^-1.
        c1: affinity.
        c2: shear.
    """

    x0: float
    y0: float
    a1: float
    a2: float
    a3: float
    r0: float
    b1: float
    b2: float
    c1: float
    c2: float

    def scaled(self, by: float) -> "Lens":
        """The same lens in an image that is `by` times as wide in px."""
        return Lens(
            self.x0 * by, self.y0 * by, self.a1 / by**2, self.a2 / by**4, self.a3 / by**6, self.r0 * by, self.b1 / by,
            self.b2 / by, self.c1, self.c2,
        )  # fmt: skip

    def bend(self, ideal: Floats, reach: float) -> Floats:
        """Image points, metric, px, of ideal points without distortion; shape (..., 2).

        Beyond the radius `reach`, far outside of the image, the distortion grows no more: a polynomial would fold the
        world back into the image there.
        """
        away = np.hypot(ideal[..., 0], ideal[..., 1])
        near = ideal * np.minimum(1.0, reach / np.maximum(away, reach))[..., None]
        x, y = near[..., 0], near[..., 1]
        r2, p2 = x * x + y * y, self.r0**2
        radial = self.a1 * (r2 - p2) + self.a2 * (r2**2 - p2**2) + self.a3 * (r2**3 - p2**3)
        dx = x * radial + self.b1 * (r2 + 2 * x * x) + 2 * self.b2 * x * y + self.c1 * x + self.c2 * y
        dy = y * radial + self.b2 * (r2 + 2 * y * y) + 2 * self.b1 * x * y
        return np.asarray(ideal + np.stack((self.x0 + dx, self.y0 + dy), axis=-1))


@dataclass(frozen=True, slots=True)
class Window:
    """The part of a camera's images that is recorded.

    Attributes:
        full: width and height of the image that the camera draws, px.
        left: its first column that is recorded; may be negative, if the camera draws more than that.
        top: likewise, row.
        width: columns that are recorded.
        height: rows that are recorded.
    """

    full: tuple[int, int]
    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True, slots=True)
class Projection:
    """A camera with its place and orientation.

    Attributes:
        X0: projection centre, m, shape (3,).
        R: rotation, shape (3, 3); r1 points right, r2 up, r3 backwards, away from the scene.
        c: principal distance, px.
        width: columns of the image.
        height: rows of the image.
        lens: principal point and distortion; None: image centre, none.
        reach: radius beyond which the distortion grows no more, px; None: three quarters of the image's diagonal.
    """

    X0: Floats
    R: Floats
    c: float
    width: int
    height: int
    lens: Lens | None = None
    reach: float | None = None

    @property
    def _reach(self) -> float:
        return 0.75 * math.hypot(self.width, self.height) if self.reach is None else self.reach

    def windowed(self, window: Window) -> "Projection":
        """The camera with that part of its image alone: the principal point moves against the image's centre."""
        right = (self.width - 1) / 2 - window.left - (window.width - 1) / 2
        down = (self.height - 1) / 2 - window.top - (window.height - 1) / 2
        lens = self.lens
        if right or down:
            lens = lens or Lens(*[0.0] * 10)
            lens = replace(lens, x0=lens.x0 + right, y0=lens.y0 - down)
        return replace(self, width=window.width, height=window.height, lens=lens, reach=self._reach)

    def pixels(self, points: ArrayLike) -> Floats:
        """Pixel coordinates (x, y) of object points by Eq. (A1); shape (..., 3) to (..., 2).

        The coordinates of points behind the camera mean nothing: check `distance`.
        """
        along = (np.asarray(points, float) - self.X0) @ self.R
        metric = -self.c * along[..., :2] / along[..., 2:]
        if self.lens is not None:
            metric = self.lens.bend(metric, reach=self._reach)
        return np.stack(((self.width - 1) / 2 + metric[..., 0], (self.height - 1) / 2 - metric[..., 1]), axis=-1)

    def distance(self, points: ArrayLike) -> Floats:
        """Distance along the optical axis, m, positive in front of the camera; shape (..., 3) to (...)."""
        distance: Floats = -(np.asarray(points, float) - self.X0) @ self.R[:, 2]
        return distance

    def sees(self, pixels: ArrayLike, margin: float = 0.0) -> NDArray[np.bool_]:
        """Whether pixel coordinates, shape (..., 2), lie at least `margin` px inside the image."""
        places = np.asarray(pixels, float)
        x, y = places[..., 0], places[..., 1]
        right, bottom = self.width - 1 - margin, self.height - 1 - margin
        inside: NDArray[np.bool_] = (x >= margin) & (x <= right) & (y >= margin) & (y <= bottom)
        return inside
