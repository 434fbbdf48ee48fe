"""Measures simulated images as an image measurement would, without knowledge of how they were made."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


def centroid(image: Image, near: Sequence[float], reach: float) -> tuple[float, float]:
    """Intensity-weighted centroid within `reach` px of the spot near `near` (x, y), local background subtracted."""
    x, y = near
    margin = int(np.ceil(reach)) + 2
    rows = np.arange(round(y) - margin, round(y) + margin + 1)
    columns = np.arange(round(x) - margin, round(x) + margin + 1)
    inside = (rows >= 0) & (rows < image.shape[0])
    rows, columns = rows[inside, None], columns[(columns >= 0) & (columns < image.shape[1])]
    window = image[rows, columns].astype(float)
    mx, my = float(round(x)), float(round(y))
    for _ in range(20):
        away = np.hypot(rows - my, columns - mx)
        background = np.median(window[(away > reach) & (away <= reach + 1)])
        weight = np.where(away <= reach, window - background, 0.0)
        before = mx, my
        mx, my = float((weight * columns).sum() / weight.sum()), float((weight * rows).sum() / weight.sum())
        if np.hypot(mx - before[0], my - before[1]) < 1e-4:
            break
    return mx, my


def ridge_offset(image: Image, point: NDArray[np.float64], along: NDArray[np.float64], half: float = 4.0) -> float:
    """How far beside `point` (x, y) the middle of a bright line lies, px; `along` is its unit direction."""
    aside = np.array((-along[1], along[0]))
    steps = np.arange(-half, half + 0.01, 0.1)
    profile = np.array([_bilinear(image, *(point + s * aside)) for s in steps])
    weight = np.maximum(profile - (profile.max() + np.median(profile)) / 2, 0.0)
    return float((weight * steps).sum() / weight.sum())


def _bilinear(image: Image, x: float, y: float) -> float:
    left, top = int(np.floor(x)), int(np.floor(y))
    u, v = x - left, y - top
    a, b, c, d = image[top : top + 2, left : left + 2].astype(float).ravel()
    return float((1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * c + u * d))
