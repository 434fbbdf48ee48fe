"""An anti-aliased drawing surface for polygons: they are filled on a finer grid, which is averaged down to pixels."""

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

_FINE = 2  #: lines of the finer grid per pixel
_SHIFT = 4  #: OpenCV takes integers; this many binary places behind the point


class Canvas:
    """Draws on top of an image of shape (h, w)."""

    def __init__(self, below: NDArray[np.uint8]) -> None:
        self._shape = below.shape
        self._grid = cv2.resize(below, None, fx=_FINE, fy=_FINE, interpolation=cv2.INTER_NEAREST)

    def polygon(self, corners: ArrayLike, grey: float) -> None:
        """Fill a convex polygon; `corners` in px, shape (n, 2)."""
        fine = (np.asarray(corners, float) + 0.5) * _FINE - 0.5
        places = np.rint(fine * (1 << _SHIFT)).astype(np.int32)
        cv2.fillConvexPoly(self._grid, places, round(grey), cv2.LINE_8, _SHIFT)

    def image(self) -> NDArray[np.float32]:
        """What has been drawn, in pixels; shape (h, w)."""
        height, width = self._shape
        return cv2.resize(self._grid, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32)
