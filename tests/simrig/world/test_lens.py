"""The simulated lens against the camera model of `photogrammetry`, which shares no code with it."""

import numpy as np
import pytest

from photogrammetry.geometry.camera_model import INTERIOR, Lens, image_point
from rig.pulse import HillPulse
from simrig.firewire.camera.geometry import SENSOR, VGA
from simrig.programs.firewire_bus import of_whole_sensor
from simrig.world.scenario import Scenario
from simrig.world.truth import truth
from tests.simrig.images.measuring import centroid, ridge_offset
from tests.simrig.images.scenes import RATE_HZ, Renderer, with_keys

LENS = {
    "x0": 4.0, "y0": -7.0, "a1": -6e-8, "a2": 2e-14, "a3": 1e-20, "r0": 150.0, "b1": 2e-6, "b2": -3e-6, "c1": 4e-4,
    "c2": -2e-4,
}  # fmt: skip


@pytest.fixture(scope="module")
def bent(calm: Scenario) -> Scenario:
    return with_keys(calm, cameras={"lens": LENS})


def test_the_middle_of_a_larger_sensor_shows_the_same(bent: Scenario, calm: Scenario) -> None:
    points = np.random.default_rng(3).uniform((0, -8, -6), (20, 8, 2), (50, 3))
    for scenario in (bent, calm):
        for small, large in zip(scenario.cameras, of_whole_sensor(scenario).cameras, strict=True):
            spots = large.projection(*SENSOR).pixels(points) - (np.array(SENSOR) - VGA) / 2
            assert spots == pytest.approx(small.projection(*VGA).pixels(points), abs=1e-9)


@pytest.mark.parametrize("size", [(640, 480), (1936, 1216)])
def test_truth_and_photogrammetry_agree_on_where_a_point_appears(bent: Scenario, size: tuple[int, int]) -> None:
    known = truth(bent, map(HillPulse, range(30, 70)), RATE_HZ, size)
    points = [ball["X"] for ball in known["balls"].values()]
    shifts = []
    for name, camera in known["cameras"].items():
        lens = Lens(np.array([camera[key] for key in INTERIOR]), np.array(camera["r0"]), np.array(False))
        metric = image_point(lens, np.array(camera["R"]), np.array(camera["X0"]), np.array(points))
        width, height = camera["size"]
        expected = np.stack(((width - 1) / 2 + metric[:, 0], (height - 1) / 2 - metric[:, 1]), axis=1)
        spots = known["ball_images"][name]
        for spot, place in zip(spots.values(), expected, strict=True):
            if spot is not None:
                assert spot == pytest.approx(place.tolist(), abs=1e-9)
        plain = bent.cameras[0].model_copy(update={"lens": type(bent.cameras[0].lens)()})
        if name == "K1":
            shifts = np.hypot(*(plain.projection(*size).pixels(points) - expected).T)
    assert np.max(shifts) > 3.0 * size[0] / 640


def test_images_are_drawn_with_the_distortion(bent: Scenario) -> None:
    known, picture = truth(bent, [HillPulse(60)], RATE_HZ), Renderer(bent)(60)
    for spot in known["ball_images"]["K1"].values():
        if spot is not None and 10 < spot[0] < 629 and 10 < spot[1] < 469:
            assert np.hypot(*np.subtract(centroid(picture, spot, 4.5), spot)) < 0.03
    for spot in known["pulses"][0]["images"]["K1"].values():
        assert np.hypot(*np.subtract(centroid(picture, spot, 3.3), spot)) < 0.05


def test_a_ski_is_bent_as_the_lens_bends_it(calm: Scenario) -> None:
    """Strong distortion: the ski's middle follows the projected line, not the chord between its ends."""
    strong = with_keys(calm, cameras={"lens": {"a1": -8e-7}})
    projection, known = strong.cameras[0].projection(640, 480), truth(strong, [HillPulse(54)], RATE_HZ)
    ski, picture = known["pulses"][0]["skis"]["right"], Renderer(strong)(54)
    point, along = np.array(ski["point"]), np.array(ski["direction"])
    offsets = []
    for s in (-1.1, -0.9, 0.7, 0.9, 1.1):
        here, there = projection.pixels([point + s * along, point + (s + 0.05) * along])
        offsets.append(ridge_offset(picture, here, (there - here) / np.hypot(*(there - here)), half=3.0))
    assert np.median(np.abs(offsets)) < 0.12


def test_what_is_far_outside_is_not_folded_into_the_image(bent: Scenario) -> None:
    projection = bent.cameras[0].projection(640, 480)
    aside = np.linspace(0.0, 5.0, 60)
    points = projection.X0 + 40 * (-projection.R[:, 2] + aside[:, None] * projection.R[:, 0])
    assert (np.diff(projection.pixels(points)[:, 0]) > 0).all()
