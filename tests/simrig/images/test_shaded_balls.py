"""Balls in the light of a sun: true in place and size, bright where the sun is, whatever the lens does."""

import numpy as np
import pytest

from simrig.images.scene.drawing import Blob
from simrig.images.scene.shaded_ball import ShadedBall
from simrig.images.view import CameraView
from simrig.world.conditions.effects import Light, Sun
from simrig.world.projection import Lens, Projection
from simrig.world.scenario import Scenario
from tests.simrig.images.measuring import centroid
from tests.simrig.images.test_view import RATE_HZ, SIZE, image

EVEN = Sun(azimuth_deg=0, elevation_deg=90, direct=0, sky=1, snow=1)
FRONT = Projection(np.zeros(3), np.array(((1.0, 0, 0), (0, 0, -1.0), (0, 1.0, 0))), 1400.0, 641, 481)


def _drawn(
    sun: Sun, projection: Projection = FRONT, centre: tuple[float, float, float] = (0.0, 30.0, 0.0)
) -> np.ndarray:
    picture = np.zeros((481, 641), np.float32)
    ShadedBall(sun, np.array(centre), 0.095, 0.55, 200.0).draw(picture, projection)
    return picture


def test_an_evenly_lit_ball_is_the_uniform_disc() -> None:
    disc = np.zeros((481, 641), np.float32)
    Blob(0.095 * 1400 / 30, 0.55).draw(disc, 320.0, 240.0, 200.0)
    assert np.abs(_drawn(EVEN) - disc).max() < 1.5


def test_what_is_behind_shows_beside_the_ball_alone() -> None:
    picture = np.full((481, 641), 50.0, np.float32)
    ShadedBall(EVEN, np.array((0.0, 30.0, 0.0)), 0.095, 0.55, 50.0).draw(picture, FRONT)
    assert np.abs(picture - 50).max() < 0.5


@pytest.mark.parametrize(("azimuth", "sign"), [(0, 1), (180, -1)])
def test_the_bright_side_is_where_the_sun_is(azimuth: float, sign: int) -> None:
    """This camera looks along Y: X is to the right in its image."""
    lit = _drawn(Sun(azimuth_deg=azimuth, elevation_deg=10, direct=1, sky=0, snow=0))
    columns = (lit.sum(axis=0) @ np.arange(641)) / lit.sum() - 320
    assert 1.5 < sign * columns < 3.5  # of a radius of 4.4 px
    assert lit.max() <= 200


def test_a_ball_behind_a_bent_lens_is_where_its_centre_is() -> None:
    bent = Projection(FRONT.X0, FRONT.R, 1400.0, 641, 481, Lens(4, -3, -6e-8, 0, 0, 0, 1e-6, -1e-6, 1e-3, 1e-3))
    centre = (4.0, 30.0, 2.5)
    place = bent.pixels(centre)
    assert np.hypot(*(np.array(centroid(_drawn(EVEN, bent, centre), list(place), 7.0)) - place)) < 0.02


def test_a_scenario_with_a_sun_shades_its_balls_and_nothing_else(calm: Scenario) -> None:
    sun = Sun(azimuth_deg=-90, elevation_deg=20)
    lit = calm.model_copy(update={"light": Light(sun=sun)})
    before, after = (image(CameraView(scenario, 0, *SIZE, RATE_HZ), 0).astype(float) for scenario in (calm, lit))
    changed = np.abs(before - after) > 3
    near = np.zeros_like(changed)
    projection = calm.cameras[0].projection(*SIZE)
    for ball in calm.balls:
        x, y = np.rint(projection.pixels(ball.X)).astype(int)
        near[max(0, y - 6) : y + 7, max(0, x - 6) : x + 7] = True
    assert changed.any()
    assert not (changed & ~near).any()
