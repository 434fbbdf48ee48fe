import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rig.images.viewing import look_at
from simrig.world.projection import Projection

COORDINATES = st.floats(-80, 80)
POINTS = st.tuples(COORDINATES, COORDINATES, COORDINATES)


def test_a_camera_beside_the_flight_sees_it_from_left_to_right() -> None:
    """Closed form: camera 40 m to the right of the flight, looking across it."""
    camera = Projection(np.array((10.0, -40.0, 0.0)), look_at((10, -40, 0), (10, 0, 0)), 1420.0, 640, 480)
    assert camera.pixels((12.0, 0.0, 3.0)) == pytest.approx((319.5 + 1420 * 2 / 40, 239.5 - 1420 * 3 / 40))
    assert camera.pixels((10.0, 10.0, -1.0)) == pytest.approx((319.5, 239.5 + 1420 / 50))
    assert float(camera.distance((12.0, 5.0, 3.0))) == pytest.approx(45.0)


@given(POINTS, POINTS, st.floats(-180, 180))
def test_look_at_is_a_rotation_that_puts_its_target_into_the_middle(
    place: tuple[float, float, float], target: tuple[float, float, float], roll: float
) -> None:
    assume(math.dist(place[:2], target[:2]) > 0.5)
    rotation = look_at(place, target, roll)
    assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    camera = Projection(np.array(place), rotation, 1500.0, 641, 481)
    assert camera.pixels(target) == pytest.approx((320.0, 240.0), abs=1e-6)
    assert float(camera.distance(target)) == pytest.approx(math.dist(place, target))


def test_a_roll_turns_the_camera_clockwise() -> None:
    camera = Projection(np.zeros(3), look_at((0, 0, 0), (0, 10, 0), 90.0), 100.0, 201, 201)
    assert camera.pixels((1.0, 10.0, 0.0)) == pytest.approx((100.0, 90.0), abs=1e-9)


def test_many_points_at_once_equal_one_at_a_time() -> None:
    camera = Projection(np.array((1.0, -30.0, 4.0)), look_at((1, -30, 4), (9, 0, -2)), 1400.0, 640, 480)
    points = np.random.default_rng(3).uniform(-5, 20, (4, 7, 3))
    together = camera.pixels(points)
    assert together.shape == (4, 7, 2)
    for at in np.ndindex(4, 7):
        assert together[at] == pytest.approx(camera.pixels(points[at]))


def test_the_corner_pixels_are_in_sight() -> None:
    camera = Projection(np.zeros(3), np.eye(3), 100.0, 640, 480)
    assert camera.sees([(0, 0), (639, 479), (-0.1, 5), (5, 479.1)]).tolist() == [True, True, False, False]
