"""Draws dense snowfall, and snow on the lens."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from simrig.images.scene.drawing import Image
from simrig.world.scenario import REFERENCE_WIDTH

_FLAKE = 205.0  #: radiance
LENS_SNOW = 175.0  #: radiance of snow on the lens
_COVER = 0.2  #: share of the view that flakes cover at density 1


class DenseSnow:
    """Snow in three depths: each is a pattern that falls at its own speed and repeats itself after some seconds.

    Args:
        density: 0 to 1.
        width: width of the image, px.
        height: height of the image, px.
        rng: decides where the flakes are.
    """

    #: Radius (sigma), px; opacity; speed across and down, px/s. All px at an image width of 640.
    _DEPTHS = ((0.6, 0.45, 14.0, 70.0), (0.95, 0.65, 33.0, 121.0), (2.2, 0.55, 71.0, 263.0))

    def __init__(self, density: float, width: int, height: int, rng: np.random.Generator) -> None:
        scale = width / REFERENCE_WIDTH
        self._size = width, height
        self._layers = []
        for sigma, opacity, across, down in self._DEPTHS:
            radius = max(0.5, sigma * scale)
            flakes = round(density * _COVER / len(self._DEPTHS) * width * height / (math.pi * (1.5 * radius) ** 2))
            tile = _flakes(width, height, flakes, radius, opacity, rng)
            self._layers.append((np.tile(tile, (2, 2)), across * scale, down * scale))
        self._cover = np.empty((height, width), np.uint8)
        self._part = np.empty((height, width), np.float32)

    def draw(self, image: Image, scene_s: float) -> None:
        """Draw the snow of scene time `scene_s` into an image of radiance, shape (h, w), in place."""
        width, height = self._size
        self._cover[...] = 0
        for pattern, across, down in self._layers:
            left, top = round(-across * scene_s) % width, round(-down * scene_s) % height
            np.maximum(self._cover, pattern[top : top + height, left : left + width], out=self._cover)
        np.multiply(self._cover, np.float32(1 / 255), out=self._part)
        self._part *= np.float32(_FLAKE) - image
        image += self._part


def lens_snow(blobs: int, width: int, height: int, rng: np.random.Generator) -> Image:
    """Opacity of the snow on a lens, shape (h, w): soft blobs, far out of focus."""
    cover = np.zeros((height, width), np.float32)
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    for _ in range(blobs):
        x, y, radius = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(0.008, 0.035) * width
        cover = np.maximum(cover, rng.uniform(0.15, 0.6) * _soft(rows - y, columns - x, radius))
    return cover


def _soft(down: Image, right: Image, radius: float) -> Image:
    """A disc of which the border fades out, shape (h, w)."""
    away = np.sqrt(down * down + right * right) / np.float32(radius)
    soft: Image = np.clip(1.5 - away, 0, 1)
    return soft * soft * (3 - 2 * soft)


def _flakes(
    width: int, height: int, count: int, radius: float, opacity: float, rng: np.random.Generator
) -> NDArray[np.uint8]:
    """Opacity, 0 to 255, of a pattern of flakes that continues beyond its borders, shape (h, w)."""
    impulses = np.zeros((height, width), np.float32)
    np.add.at(impulses, (rng.integers(0, height, count), rng.integers(0, width, count)), rng.uniform(0.5, 1.0, count))
    margin = math.ceil(4 * radius) + 1
    wrapped = np.pad(impulses, margin, mode="wrap")
    blurred = cv2.GaussianBlur(wrapped, (0, 0), radius)[margin:-margin, margin:-margin]
    peak = opacity * 2 * math.pi * radius**2
    return np.asarray(np.clip(255 * peak * blurred, 0, 250)).astype(np.uint8)
