"""Anti-aliased drawing with sub-pixel accuracy: polygons, capsules (limbs, skis, poles) and small bright discs."""

import math
from functools import cache
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rig.arrays import Floats

Image = NDArray[np.float32]  #: grey values, shape (h, w)
_Field = NDArray[np.floating[Any]]

_FINE = 2  #: lines of the canvas' grid per pixel
_SHIFT = 4  #: OpenCV takes integers; this many binary places behind the point
_FADE = 2.4  #: px over which a capsule's border fades: pixel and lens together, about that of a blur of 0.6 px
_STEP = 0.02  #: px between samples of a blob's profile
REACH_SIGMA: Final = 4.5  #: a profile ends this many sigmas outside the disc, where it is below 1e-5
PIXEL_VARIANCE: Final = 1 / 12  #: px^2, of integration over a pixel


class Canvas:
    """Fills polygons on a finer grid over an image of shape (h, w), and averages that down to pixels."""

    def __init__(self, below: NDArray[np.uint8]) -> None:
        self._shape = below.shape
        self._grid = cv2.resize(below, None, fx=_FINE, fy=_FINE, interpolation=cv2.INTER_NEAREST)

    def polygon(self, corners: ArrayLike, grey: float) -> None:
        """Fill a convex polygon; `corners` in px, shape (n, 2)."""
        self.fill(self.on_grid(corners), grey)

    def fill(self, places: NDArray[np.int32], grey: float) -> None:
        """Fill a convex polygon with corners on the grid, shape (n, 2)."""
        cv2.fillConvexPoly(self._grid, places, round(grey), cv2.LINE_8, _SHIFT)

    @staticmethod
    def on_grid(corners: ArrayLike) -> NDArray[np.int32]:
        """Where corners, px, are on the canvas' grid; shape (..., 2)."""
        fine = (np.asarray(corners, float) + 0.5) * _FINE - 0.5
        return np.rint(fine * (1 << _SHIFT)).astype(np.int32)

    def image(self) -> Image:
        """The drawing in pixels, shape (h, w)."""
        height, width = self._shape
        return cv2.resize(self._grid, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32)


def stroke(image: Image, a: Floats, b: Floats, radius_a: float, radius_b: float, grey: float) -> None:
    """Blend a capsule (the hull of two discs) into an image, in place.

    Its cross section is symmetric, so that the middle of the drawn capsule lies on the line from `a` to `b`.

    Args:
        image: shape (h, w).
        a: centre of one disc, px, shape (2,).
        b: centre of the other; may equal `a`.
        radius_a: radius of the disc at `a`, px.
        radius_b: likewise at `b`.
        grey: grey value of the capsule.
    """
    reach = max(radius_a, radius_b) + _FADE
    left, right = max(0, math.floor(min(a[0], b[0]) - reach)), math.ceil(max(a[0], b[0]) + reach) + 1
    top, bottom = max(0, math.floor(min(a[1], b[1]) - reach)), math.ceil(max(a[1], b[1]) + reach) + 1
    window = image[top : max(0, bottom), left : max(0, right)]
    if not window.size:
        return
    across: _Field = np.arange(left, left + window.shape[1], dtype=np.float32) - np.float32(a[0])
    down: _Field = np.arange(top, top + window.shape[0], dtype=np.float32)[:, None] - np.float32(a[1])
    radius: _Field = np.full(1, radius_a, np.float32)
    dx, dy = float(b[0] - a[0]), float(b[1] - a[1])
    square = dx * dx + dy * dy
    if square > 0:
        part = np.clip(across * (dx / square) + down * (dy / square), 0, 1)
        across, down = across - part * dx, down - part * dy
        radius = radius + (radius_b - radius_a) * part
    cover = np.clip((radius - np.sqrt(across * across + down * down)) / _FADE + 0.5, 0, 1)
    window += cover * cover * (3 - 2 * cover) * (np.float32(grey) - window)


class Blob:
    """The image of a uniform disc, true in position to a few thousandths of a pixel.

    A disc, blurred by the lens and integrated over the area of each pixel, keeps its centre of gravity. The lens is a
    Gaussian; integration over a pixel's area acts like one more blur, of variance 1/12 px^2. The sum is a smooth radial
    profile, sampled at the pixels' centres; it is so wide that aliasing is negligible.

    Args:
        radius_px: radius of the disc.
        blur_sigma_px: blur of the lens.
    """

    def __init__(self, radius_px: float, blur_sigma_px: float) -> None:
        sigma = math.sqrt(blur_sigma_px**2 + PIXEL_VARIANCE)
        self.reach_px = radius_px + REACH_SIGMA * sigma
        self._radii = np.arange(0.0, self.reach_px + _STEP, _STEP)
        self._profile = _blurred_disc(self._radii, radius_px, sigma)

    def draw(self, image: Image, x: float, y: float, grey: float, scale: float = 1.0) -> None:
        """Blend the blob, `scale` times as large, into `image` (h, w) at pixel coordinates (x, y), in place."""
        reach = self.reach_px * scale
        top, left = max(0, math.ceil(y - reach)), max(0, math.ceil(x - reach))
        window = image[top : math.floor(y + reach) + 1, left : math.floor(x + reach) + 1]
        if not window.size or y + reach < 0 or x + reach < 0:
            return
        down = np.arange(top, top + window.shape[0]) - y
        right = np.arange(left, left + window.shape[1]) - x
        radii = np.sqrt(down[:, None] ** 2 + right**2) / scale
        cover = np.interp(radii, self._radii, self._profile, right=0.0).astype(np.float32)
        window += cover * (np.float32(grey) - window)


def _blurred_disc(radii: Floats, disc: float, sigma: float) -> Floats:
    """Radial profile of a disc convolved with a Gaussian: quadrature over the chords of the disc."""
    nodes, weights = _quadrature()
    u = disc * nodes
    chord = np.array([math.erf(half) for half in (np.sqrt(disc**2 - u**2) / (math.sqrt(2) * sigma)).tolist()])
    line = np.exp(-((radii[:, None] - u) ** 2) / (2 * sigma**2)) / (math.sqrt(2 * math.pi) * sigma)
    return np.asarray(line @ (chord * weights * disc))


@cache
def _quadrature() -> tuple[Floats, Floats]:
    """Nodes and weights of Gauss and Legendre in [-1, 1], each of shape (96,)."""
    nodes, weights = np.polynomial.legendre.leggauss(96)
    return nodes, weights


def fill(image: Image, corners: ArrayLike, grey: float) -> None:
    """Fill a convex polygon with anti-aliased borders, in place; `corners` in px, shape (n, 2)."""
    places = np.asarray(corners, float)
    left, top = (max(0, math.floor(v) - 1) for v in places.min(axis=0))
    right, bottom = (math.ceil(v) + 2 for v in places.max(axis=0))
    window = image[top : max(0, bottom), left : max(0, right)]
    if not window.size:
        return
    mask = np.zeros(window.shape, np.uint8)
    fixed = np.rint((places - (left, top)) * (1 << _SHIFT)).astype(np.int32)
    cv2.fillConvexPoly(mask, fixed, 255, cv2.LINE_AA, _SHIFT)
    window += mask * np.float32(1 / 255) * (np.float32(grey) - window)


def cut(image: Image, corners: Floats, grey: float) -> None:
    """Fill a convex polygon with hard borders, in place: faster than `fill`; `corners` in px, shape (n, 2)."""
    cv2.fillConvexPoly(image, np.rint(corners * (1 << _SHIFT)).astype(np.int32), grey, cv2.LINE_8, _SHIFT)
