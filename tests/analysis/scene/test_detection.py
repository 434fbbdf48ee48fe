"""Balls are found where they are, with sigmas that hold; edges, stripes and letters are not balls."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from analysis.scene.detection import Detections, detect_balls
from analysis.scene.static_image import static_image
from tests.analysis.scene.hill import balls_in, hill_images, training, training_images
from tests.analysis.scene.rendering import Spot, clean_image, frames

SIZE = (420, 320)


def _spots(rng: np.random.Generator, dark: bool) -> list[Spot]:
    """Balls on a grid with random places, sizes and contrasts."""
    spots = []
    for x in range(35, SIZE[0] - 30, 50):
        for y in range(35, SIZE[1] - 30, 50):
            radius = float(np.exp(rng.uniform(np.log(1.5), np.log(13))))
            contrast = (-1 if dark else 1) * rng.uniform(40, 110)
            spots.append(Spot(x + rng.uniform(-2, 2), y + rng.uniform(-2, 2), radius, contrast))
    return spots


def _matched(found: Detections, spots: list[Spot]) -> tuple[list[int], list[Spot]]:
    places = np.array([(spot.x, spot.y) for spot in spots])
    nearest = [int(np.hypot(*(found.xy - place).T).argmin()) for place in places]
    near = [float(np.hypot(*(found.xy[k] - place))) < 1.0 for k, place in zip(nearest, places, strict=True)]
    hits = [k for k, good in zip(nearest, near, strict=True) if good]
    return hits, [spot for spot, good in zip(spots, near, strict=True) if good]


@pytest.mark.parametrize("dark", [False, True], ids=["bright on dark", "dark on bright"])
def test_balls_are_found_with_sigmas_that_hold(dark: bool) -> None:
    rng = np.random.default_rng(21)
    squares, found_balls, balls, others = [], 0, 0, 0
    for _ in range(4):
        spots = _spots(rng, dark)
        y, x = np.mgrid[: SIZE[1], : SIZE[0]]
        background = (190 if dark else 50) + rng.uniform(-0.04, 0.04) * (x - 210) + rng.uniform(-0.04, 0.04) * (y - 160)
        clean = clean_image(SIZE, spots, background, rng.uniform(0.5, 1.0))
        found = detect_balls(static_image("K1", frames(clean, 2.0, 0.02, 9, rng)))
        hits, seen = _matched(found, spots)
        off = found.xy[hits] - [(spot.x, spot.y) for spot in seen]
        squares += list(np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.covariance[hits]), off) / 2)
        assert found.radius[hits] == pytest.approx([spot.radius for spot in seen], rel=0.15)
        assert (found.contrast[hits] < 0).all() == dark
        balls, found_balls, others = balls + len(spots), found_balls + len(hits), others + len(found) - len(hits)
    assert found_balls >= 0.97 * balls
    assert others <= 0.02 * balls
    assert 0.8 < float(np.mean(squares)) < 1.25


def test_noise_makes_no_balls() -> None:
    rng = np.random.default_rng(22)
    images = frames(np.full((320, 420), 90.0), 4.0, 0.05, 9, rng)
    assert len(detect_balls(static_image("K1", images))) <= 1


def test_edges_stripes_and_letters_are_few_among_the_balls() -> None:
    rng = np.random.default_rng(23)
    drawn = np.full((SIZE[1], SIZE[0]), 60, np.uint8)
    cv2.putText(drawn, "SVEV 2026 NORGE", (10, 60), cv2.FONT_HERSHEY_SIMPLEX, 1.4, 200, 3, cv2.LINE_AA)
    for x in range(20, 400, 16):
        drawn[100:180, x : x + 7] = 180
    cv2.fillConvexPoly(drawn, np.array([[20, 300], [200, 200], [390, 310]]), 170)
    spots = [Spot(x + 0.3, 230.4, 3.0, 120.0) for x in (40, 90)]
    clean = clean_image(SIZE, spots, gaussian_filter(drawn.astype(float), 0.4), 0.6)
    found = detect_balls(static_image("K1", frames(clean, 2.0, 0.0, 9, rng)))
    hits, seen = _matched(found, spots)
    assert len(seen) == 2
    assert len(found) <= 12
    assert max(hits) <= 3  # the best ones


def test_every_ball_of_the_simulated_hill_is_found() -> None:
    squares = []
    for camera, image in training_images().items():
        found = detect_balls(image)
        assert len(found) <= 35
        for name, place in balls_in(training(), camera).items():
            off = found.xy - place
            nearest = int(np.hypot(*off.T).argmin())
            assert np.hypot(*off[nearest]) < 0.1, f"{name} in {camera}"
            assert nearest < 25  # true balls come first
            squares.append(off[nearest] @ np.linalg.inv(found.covariance[nearest]) @ off[nearest] / 2)
    assert 0.6 < float(np.mean(squares)) < 1.4


def test_balls_of_a_large_image_are_found() -> None:
    size = (1600, 1200)
    scenario = training().model_copy(update={"cameras": training().cameras[1:2]})
    found = detect_balls(hill_images(scenario, size, 5)["K2"])
    for name, place in balls_in(scenario, "K2", size).items():
        assert np.hypot(*(found.xy - place).T).min() < 0.2, name
