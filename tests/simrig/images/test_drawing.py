import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from simrig.images.scene.drawing import Blob, Canvas, stroke
from simrig.images.view import Snowfall
from tests.simrig.images.measuring import centroid

PLACES = st.tuples(st.floats(18, 30), st.floats(18, 30))


def moments(image: NDArray[np.floating[Any]]) -> tuple[float, float, float]:
    """Sum and centroid (x, y) of an image."""
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    total = float(image.sum())
    return total, float((image * columns).sum() / total), float((image * rows).sum() / total)


@given(PLACES, st.floats(0.8, 6), st.floats(0.4, 1.5))
def test_a_blob_lies_where_it_was_put_and_has_its_area(place: tuple[float, float], radius: float, blur: float) -> None:
    image = np.zeros((49, 49), np.float32)
    Blob(radius, blur).draw(image, *place, grey=200.0)
    area, x, y = moments(image / 200)
    assert area == pytest.approx(math.pi * radius**2, rel=0.01)
    assert (x, y) == pytest.approx(place, abs=4e-3)


@given(PLACES)
def test_a_blob_is_measured_where_it_was_put(place: tuple[float, float]) -> None:
    image = np.full((49, 49), 40.0, np.float32)
    Blob(1.6, 0.55).draw(image, *place, grey=225.0)
    assert centroid(np.rint(image).astype(np.uint8), place, 4.2) == pytest.approx(place, abs=0.01)


@pytest.mark.parametrize("place", [(-4.0, 5.0), (5.0, -4.0), (50.0, 5.0), (5.0, 50.0), (-90.0, -90.0)])
def test_a_blob_outside_of_the_image_leaves_it_alone(place: tuple[float, float]) -> None:
    image = np.zeros((40, 40), np.float32)
    Blob(1.0, 0.4).draw(image, *place, grey=100.0)
    assert image.sum() == 0


@given(PLACES, st.floats(0, 2 * math.pi), st.floats(1.2, 3))
def test_the_middle_of_a_stroke_lies_on_its_axis(place: tuple[float, float], angle: float, radius: float) -> None:
    image, along = np.zeros((49, 49), np.float32), np.array((math.cos(angle), math.sin(angle)))
    a, b = np.array(place) - 10 * along, np.array(place) + 10 * along
    stroke(image, a, b, radius, radius, 200.0)
    area, x, y = moments(image / 200)
    assert (x, y) == pytest.approx(place, abs=0.02)
    assert area == pytest.approx(math.pi * radius**2 + 40 * radius, rel=0.1)


@given(PLACES, st.floats(1.5, 8))
def test_a_stroke_of_no_length_is_a_disc(place: tuple[float, float], radius: float) -> None:
    image = np.zeros((49, 49), np.float32)
    stroke(image, np.array(place), np.array(place), radius, radius, 200.0)
    area, x, y = moments(image / 200)
    assert (x, y) == pytest.approx(place, abs=0.02)
    assert math.sqrt(area / math.pi) == pytest.approx(radius, rel=0.1)


@pytest.mark.parametrize("place", [(-9.0, 5.0), (5.0, -9.0), (60.0, 5.0), (5.0, 60.0)])
def test_a_stroke_outside_of_the_image_leaves_it_alone(place: tuple[float, float]) -> None:
    image = np.zeros((40, 40), np.float32)
    stroke(image, np.array(place), np.array(place) + 1, 2.0, 3.0, 100.0)
    assert image.sum() == 0


def test_a_polygon_covers_its_area() -> None:
    canvas = Canvas(np.zeros((60, 60), np.uint8))
    canvas.polygon([(10, 10), (50, 10), (50, 30), (10, 30)], 200)
    area, x, y = moments(canvas.image() / 200)
    assert area == pytest.approx(40 * 20, rel=0.06)
    assert (x, y) == pytest.approx((30, 20), abs=0.3)


def test_snow_falls_and_stays_in_the_image() -> None:
    snow, image = Snowfall(50, 64, 48, np.random.default_rng(1)), np.full((48, 64), 90, np.uint8)
    pictures = []
    for time in (0.0, 0.1, 1e6):
        picture = image.copy()
        snow.draw(picture, time)
        pictures.append(picture)
        assert 0.05 < (picture != image).mean() < 0.9
        assert picture.min() >= 89
        assert picture.max() <= 215
    assert not np.array_equal(pictures[0], pictures[1])


def test_no_flakes_change_nothing() -> None:
    image = np.full((48, 64), 90, np.uint8)
    Snowfall(0, 64, 48, np.random.default_rng(1)).draw(image, 1.0)
    assert (image == 90).all()
