"""Focus measure, peaking and exposure: they have to follow the lens, not the light, the noise or the kind of pixels."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.images.aids import exposure, focus, sharp

ROWS, COLUMNS = 240, 320


def _scene(spread_px: float, *, light: float = 1.0, noise: float = 1.0, mosaic: bool = False) -> NDArray[np.uint8]:
    """Balls and bars before snow through a lens that spreads points by so much; a mosaic sees red, green, blue."""
    scene = np.full((ROWS, COLUMNS), 150.0, np.float32)
    for column in range(30, COLUMNS, 60):
        cv2.circle(scene, (column, 60), 9, 40.0, -1, cv2.LINE_AA)
        cv2.rectangle(scene, (column, 120), (column + 20, 200), 230.0, -1)
    if spread_px:
        scene = np.asarray(cv2.GaussianBlur(scene, (0, 0), spread_px), np.float32)
    if mosaic:
        scene[0::2, 0::2] *= 0.6
        scene[1::2, 1::2] *= 0.8
    noisy = scene * light + np.random.default_rng(3).normal(0, noise, scene.shape)
    return np.clip(np.round(noisy), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("mosaic", [False, True], ids=["grey", "mosaic"])
@pytest.mark.parametrize("noise", [0.5, 4.0], ids=["little noise", "much noise"])
def test_the_measure_is_largest_where_the_lens_is_sharpest(mosaic: bool, noise: float) -> None:
    measured = [focus(_scene(spread, noise=noise, mosaic=mosaic), mosaic=mosaic) for spread in (6, 4, 2, 1, 0)]
    assert measured == sorted(measured)
    assert measured[-1] > 1.15 * measured[-3] > 1.15 * 1.15 * measured[-4]


def test_the_measure_does_not_follow_the_light() -> None:
    bright, dark = (focus(_scene(1.0, light=light, noise=0.5), mosaic=False) for light in (1.0, 0.25))
    assert dark == pytest.approx(bright, rel=0.03)
    assert focus(np.zeros((ROWS, COLUMNS), np.uint8), mosaic=False) == 0.0


@pytest.mark.parametrize("mosaic", [False, True], ids=["grey", "mosaic"])
def test_peaking_marks_edges_in_focus_and_nothing_else(mosaic: bool) -> None:
    """Of each bar's left edge, 80 px long, in the sharp and in the blurred image; and of the snow above the balls."""
    near, far = (sharp(_scene(spread, mosaic=mosaic), mosaic=mosaic) for spread in (0.3, 6.0))
    edges = [slice(column - 3, column + 4) for column in range(30, COLUMNS, 60)]
    assert all(near[130:190, edge].any(axis=1).mean() > 0.95 for edge in edges)
    assert far.mean() < 1e-3
    assert not near[:40].any()
    noise = np.random.default_rng(4).normal(120, 6, (ROWS, COLUMNS)).astype(np.uint8)
    assert sharp(noise, mosaic=mosaic).mean() < 1e-3


def test_clipped_pixels_are_counted_by_colour() -> None:
    image = np.full((ROWS, COLUMNS), 100, np.uint8)
    image[0::2, 0::2] = 255  # all of the red ones
    image[:, :32] = 0
    found = exposure(image, 64)
    assert (found.clipped, found.black) == (0.25 * 0.9, 0.1)
    assert sum(found.histogram) == image.size
    assert [found.histogram[step] / image.size for step in (0, 25, 63)] == [0.1, 0.9 * 0.75, 0.9 * 0.25]
    assert found.mean == pytest.approx(float(image.mean()) / 255)
