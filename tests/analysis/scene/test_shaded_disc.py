"""Balls that the sun lights from the side, each before a plate that is hardly larger, are found before snow."""

import cv2
import numpy as np

from analysis.scene.detection import detect_balls
from analysis.scene.static_image import static_image
from rig.arrays import Floats
from tests.analysis.scene.rendering import frames

_SIZE = (520, 320)
_FINE = 8  # drawn pixels across one of the image
_SNOW, _PLATE, _POST = 150.0, 15.0, 70.0
_SHADE, _SUN = 45.0, 140.0  # grey values of a ball: in its own shadow, and what the sun adds


def _lit_balls(rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """An image without noise, and places (n, 2) and radii (n,) of its balls, px."""
    image = np.full((_SIZE[1] * _FINE, _SIZE[0] * _FINE), _SNOW, np.float32)
    y, x = np.mgrid[: image.shape[0], : image.shape[1]] / _FINE
    places = [
        (column + rng.uniform(-2, 2), row + rng.uniform(-2, 2))
        for column in range(40, _SIZE[0] - 30, 60)
        for row in range(40, _SIZE[1] - 30, 60)
    ]
    radii = rng.uniform(2.5, 5.0, len(places))
    turn, height = rng.uniform(0, 2 * np.pi), np.radians(25)
    sun = np.array((np.cos(height) * np.cos(turn), np.cos(height) * np.sin(turn), np.sin(height)))
    for (column, row), radius in zip(places, radii, strict=True):
        part = np.s_[
            int((row - 14) * _FINE) : int((row + 25) * _FINE), int((column - 14) * _FINE) : int((column + 14) * _FINE)
        ]
        dx, dy, own = x[part] - column, y[part] - row, image[part]
        own[(np.abs(dx) < 1) & (dy > 0)] = _POST
        own[np.maximum(np.abs(dx), np.abs(dy)) < 1.9 * radius] = _PLATE
        depth = np.sqrt(np.maximum(radius**2 - dx**2 - dy**2, 0))
        ball = depth > 0
        light = np.maximum(0, dx * sun[0] + dy * sun[1] + depth * sun[2])[ball] / radius
        own[ball] = _SHADE + _SUN * light
    blurred = cv2.GaussianBlur(image, (0, 0), 0.6 * _FINE)
    small = cv2.resize(blurred, _SIZE, interpolation=cv2.INTER_AREA)
    return np.asarray(small, float), np.array(places) + 0.5 / _FINE - 0.5, radii


def test_balls_in_the_sun_are_found_before_their_plates() -> None:
    rng = np.random.default_rng(31)
    near: list[bool] = []
    sound: list[bool] = []
    for _ in range(2):
        image, places, radii = _lit_balls(rng)
        found = detect_balls(static_image("K1", frames(image, 2.0, 0.02, 9, rng)))
        for place, radius in zip(places, radii, strict=True):
            off = found.xy - place
            nearest = int(np.hypot(*off.T).argmin())
            near.append(bool(np.hypot(*off[nearest]) < 0.5 * radius))
            sigma = np.sqrt(np.trace(found.covariance[nearest]) / 2)
            sound.append(bool(np.hypot(*off[nearest]) < 6 * sigma + 0.25 * radius))
        assert len(found) < 1.5 * len(places)
    assert np.mean(near) > 0.9
    assert np.mean(sound) > 0.9
