"""Draws discs, edges and bars at known places: sampled over the area of each pixel, blurred, with noise."""

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from rig.arrays import Floats

BLUR_PX, NOISE = 0.55, 2.5
_SAMPLES = 8  # of a pixel along x and along y

Scene = Callable[[Floats, Floats], Floats]


def drawn(scene: Scene, size: int, rng: np.random.Generator, noise: float = NOISE) -> NDArray[np.uint8]:
    """The image of a scene, which gives grey values at places x, y, px; (size, size)."""
    places = (np.arange(size * _SAMPLES) + 0.5) / _SAMPLES - 0.5
    fine = np.asarray(scene(places, places[:, None]), np.float32)
    fine = np.asarray(cv2.GaussianBlur(fine, (0, 0), BLUR_PX * _SAMPLES), np.float32)
    grey = fine.reshape(size, _SAMPLES, size, _SAMPLES).mean(axis=(1, 3))
    return _stored(np.rint(grey + rng.normal(0, noise, grey.shape)))


def disc(centre: Floats, radius: float, contrast: float, base: float = 70.0) -> Scene:
    """A disc before a slope."""
    return lambda x, y: (
        base + 0.2 * (x - centre[0]) + contrast * ((x - centre[0]) ** 2 + (y - centre[1]) ** 2 <= radius**2)
    )


def bar(point: Floats, angle: float, half: float, grey: tuple[float, float, float]) -> Scene:
    """A bar through a point, with grey values on one side, on it, on the other side."""

    def scene(x: Floats, y: Floats) -> Floats:
        u = (y - point[1]) * np.cos(angle) - (x - point[0]) * np.sin(angle)
        return np.where(u < -half, grey[0], np.where(u < half, grey[1], grey[2]))

    return scene


def edge(point: Floats, angle: float, grey: tuple[float, float]) -> Scene:
    """An edge through a point, with grey values on both sides."""
    return bar(point, angle, 0.0, (grey[0], grey[0], grey[1]))


def textured(size: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Something without discs: noise of some px in size."""
    rough = rng.normal(0, 60, (size, size)).astype(np.float32)
    smooth = cv2.GaussianBlur(rough, (0, 0), float(rng.uniform(0.8, 1.6)))
    return _stored(100 + smooth + rng.normal(0, NOISE, (size, size)))


def noisy(size: int, rng: np.random.Generator) -> NDArray[np.uint8]:
    """An even field."""
    return _stored(rng.normal(100, NOISE, (size, size)))


def _stored(grey: Floats) -> NDArray[np.uint8]:
    return np.asarray(np.clip(grey, 0, 255), np.uint8)
