"""An anti-aliased drawing surface: shapes are filled on a finer grid, which is averaged down to pixels."""

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

Pixels = NDArray[np.float64]

_SHIFT = 4  #: OpenCV takes integers; this many binary places behind the point
_ONE = 1 << _SHIFT


class Canvas:
    """Draws into a part of an image, in the whole image's pixel coordinates.

    Args:
        below: what is drawn upon, shape (h, w).
        left: column of the whole image in which `below` begins.
        top: likewise the row.
        fine: lines of the finer grid per pixel.
    """

    def __init__(self, below: NDArray[np.uint8], left: int = 0, top: int = 0, fine: int = 4) -> None:
        self._shape = below.shape
        self._fine = fine
        self._origin = np.array((left, top), float)
        self._grid = cv2.resize(below, None, fx=fine, fy=fine, interpolation=cv2.INTER_NEAREST)

    def polygon(self, corners: ArrayLike, grey: float) -> None:
        """Fill a convex polygon; `corners` in px, shape (n, 2)."""
        cv2.fillConvexPoly(self._grid, self._place(corners), round(grey), cv2.LINE_8, _SHIFT)

    def disc(self, centre: ArrayLike, radius: float, grey: float) -> None:
        """Fill a disc; px."""
        x, y = self._place(centre)
        cv2.circle(self._grid, (int(x), int(y)), self._length(radius), round(grey), cv2.FILLED, cv2.LINE_8, _SHIFT)

    def capsule(self, a: Pixels, b: Pixels, radius_a: float, radius_b: float, grey: float) -> None:
        """Fill the hull of two discs; `a`, `b` in px, shape (2,)."""
        along = b - a
        length = float(np.hypot(*along))
        if length > 0:
            aside = np.array((-along[1], along[0])) / length
            corners = (a + aside * radius_a, b + aside * radius_b, b - aside * radius_b, a - aside * radius_a)
            self.polygon(corners, grey)
        self.disc(a, radius_a, grey)
        self.disc(b, radius_b, grey)

    def image(self) -> NDArray[np.uint8]:
        """What has been drawn, in pixels; shape of `below`."""
        height, width = self._shape
        return cv2.resize(self._grid, (width, height), interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)

    def _place(self, pixels: ArrayLike) -> NDArray[np.int32]:
        fine: Pixels = (np.asarray(pixels, float) - self._origin + 0.5) * self._fine - 0.5
        return np.rint(fine * _ONE).astype(np.int32)

    def _length(self, pixels: float) -> int:
        return round(pixels * self._fine * _ONE)
