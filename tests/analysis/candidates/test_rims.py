"""Markers with a rim of another brightness, drawn as discs on discs without the models."""

import cv2
import numpy as np
import pytest

from analysis.candidates.background import Region
from analysis.candidates.spots import find_spots
from rig.arrays import Floats

NOISE = 1.5
_SIDE, _FINER = 41, 8
_COUNT = 12
#: Grey values of marker, rim and ground, with rims that differ from the ground as much as from the marker.
DARK_RIM, BRIGHT_RIM = (236.0, 30.0, 190.0), (30.0, 220.0, 60.0)


def _drawn(center: Floats, radius: float, rim: float, greys: tuple[float, float, float]) -> Floats:
    """A marker whose rim is so many times as large."""
    fine = (np.arange(_SIDE * _FINER) + 0.5) / _FINER - 0.5
    x, y = np.meshgrid(fine, fine)
    away = np.hypot(x - center[0], y - center[1])
    marker, of_rim, ground = greys
    drawn = np.where(away < radius, marker, np.where(away < rim * radius, of_rim, ground)).astype(np.float32)
    whole = cv2.resize(drawn, (_SIDE, _SIDE), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.GaussianBlur(whole, (0, 0), 0.6), float)


@pytest.mark.parametrize("greys", [DARK_RIM, BRIGHT_RIM], ids=["bright marker, dark rim", "dark marker, bright rim"])
@pytest.mark.parametrize("rim", [1.5, 1.8])
def test_a_marker_with_a_rim_is_found_with_a_sigma_that_holds(rim: float, greys: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(3)
    centers = (_SIDE - 1) / 2 + rng.uniform(-1.0, 1.0, (_COUNT, 2))
    images = []
    for center in centers:
        grey = (_drawn(center, 1.7, rim, greys) + NOISE * rng.standard_normal((_SIDE, _SIDE))).astype(np.float32)
        noise = np.full_like(grey, NOISE)
        images.append([Region(0, 0, grey, np.zeros_like(grey), noise, noise, np.ones(grey.shape, bool))])
    found = find_spots(images, [[40]] * _COUNT)
    squares = []
    for spots, center in zip(found, centers, strict=True):
        near = np.flatnonzero(np.linalg.norm(spots.xy - center, axis=1) < 0.5)
        if len(near):
            off = spots.xy[near[0]] - center
            squares.append(off @ np.linalg.solve(spots.covariance[near[0]], off) / 2)
    assert len(squares) >= 0.9 * _COUNT
    # 24 squares scatter by 0.3
    assert np.mean(squares) < 1.9
