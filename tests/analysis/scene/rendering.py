"""Renders discs by counting parts of pixels: knows nothing of the model that is fitted to them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from rig.arrays import Floats

_PARTS = 8  # of a pixel, along each axis


@dataclass(frozen=True, slots=True)
class Spot:
    """A disc to draw: centre and radius in px, contrast in grey values, ratio of the axes, their direction in rad."""

    x: float
    y: float
    radius: float
    contrast: float
    ratio: float = 1.0
    direction: float = 0.0


def clean_image(size: tuple[int, int], spots: Sequence[Spot], background: Floats | float, blur: float) -> Floats:
    """Discs on a background without noise, (height, width), blurred by a lens of so many px."""
    width, height = size
    image = np.zeros((height, width)) + background
    for spot in spots:
        image += spot.contrast * _share(size, spot)
    return np.asarray(gaussian_filter(image, blur, truncate=5.0))


def frames(clean: Floats, read: float, gain: float, count: int, rng: np.random.Generator) -> list[NDArray[np.uint8]]:
    """Frames with read noise and photon noise: variance = read^2 + gain * grey."""
    sigma = np.sqrt(read**2 + gain * np.maximum(clean, 0))
    return [
        np.clip(np.rint(clean + sigma * rng.standard_normal(clean.shape)), 0, 255).astype(np.uint8)
        for _ in range(count)
    ]


def _share(size: tuple[int, int], spot: Spot) -> Floats:
    """Which share of each pixel a disc covers, (height, width)."""
    reach = spot.radius * max(spot.ratio, 1 / spot.ratio) + 2
    left, right = max(0, int(spot.x - reach)), min(size[0], int(spot.x + reach) + 2)
    top, bottom = max(0, int(spot.y - reach)), min(size[1], int(spot.y + reach) + 2)
    share = np.zeros((size[1], size[0]))
    if right <= left or bottom <= top:
        return share
    steps = (np.arange(_PARTS) + 0.5) / _PARTS - 0.5
    x = (np.arange(left, right)[:, None] + steps).ravel() - spot.x
    y = ((np.arange(top, bottom)[:, None] + steps).ravel() - spot.y)[:, None]
    cosine, sine = np.cos(spot.direction), np.sin(spot.direction)
    u, v = (cosine * x + sine * y) / np.sqrt(spot.ratio), (cosine * y - sine * x) * np.sqrt(spot.ratio)
    inside = np.clip((spot.radius - np.hypot(u, v)) * _PARTS + 0.5, 0, 1)
    share[top:bottom, left:right] = inside.reshape(bottom - top, _PARTS, right - left, _PARTS).mean(axis=(1, 3))
    return share
