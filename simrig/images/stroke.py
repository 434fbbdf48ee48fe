"""Anti-aliased capsules: the hull of two discs, which is what limbs, skis and poles are drawn with."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Pixel = NDArray[np.float64]  #: x, y; shape (2,)
Field = NDArray[np.floating[Any]]

#: px over which a border fades: pixel and lens together, about that of a blur of 0.6 px.
_FADE = 2.4


def stroke(image: NDArray[np.float32], a: Pixel, b: Pixel, radius_a: float, radius_b: float, grey: float) -> None:
    """Blend the capsule from `a` to `b`, radii in px, into `image` (h, w), in place; `a` may equal `b`.

    Its cross section is symmetric, so that the middle of what is drawn lies on the line from `a` to `b`.
    """
    reach = max(radius_a, radius_b) + _FADE
    left, right = max(0, math.floor(min(a[0], b[0]) - reach)), math.ceil(max(a[0], b[0]) + reach) + 1
    top, bottom = max(0, math.floor(min(a[1], b[1]) - reach)), math.ceil(max(a[1], b[1]) + reach) + 1
    window = image[top : max(0, bottom), left : max(0, right)]
    if not window.size:
        return
    across: Field = np.arange(left, left + window.shape[1], dtype=np.float32) - np.float32(a[0])
    down: Field = np.arange(top, top + window.shape[0], dtype=np.float32)[:, None] - np.float32(a[1])
    radius: Field = np.full(1, radius_a, np.float32)
    dx, dy = float(b[0] - a[0]), float(b[1] - a[1])
    square = dx * dx + dy * dy
    if square > 0:
        part = np.clip(across * (dx / square) + down * (dy / square), 0, 1)
        across, down = across - part * dx, down - part * dy
        radius = radius + (radius_b - radius_a) * part
    cover = np.clip((radius - np.sqrt(across * across + down * down)) / _FADE + 0.5, 0, 1)
    window += cover * cover * (3 - 2 * cover) * (np.float32(grey) - window)
