from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.pulse import HillPulse
from simrig.images import stamp
from simrig.images.scene.balls import PLATE_MARGIN_PX
from simrig.images.view import CameraView
from simrig.world.scenario import Scenario
from simrig.world.truth import truth
from tests.simrig.images.measuring import centroid, ridge_offset

#: Not a multiple of anything in the scenario, so that markers fall on all parts of a pixel.
RATE_HZ = 37.3
SIZE = (640, 480)
CAMERAS = (0, 1, 2)


def blank() -> NDArray[np.uint8]:
    return np.zeros(SIZE[::-1], np.uint8)


def image(view: CameraView, pulse: int) -> NDArray[np.uint8]:
    out = blank()
    view.render_into(out, HillPulse(pulse))
    return out


@pytest.fixture(scope="module")
def known(calm: Scenario) -> dict[str, Any]:
    return truth(calm, map(HillPulse, range(round(1.9 * RATE_HZ))), RATE_HZ, SIZE)


@pytest.fixture(scope="module", params=CAMERAS, ids=lambda k: f"K{k + 1}")
def camera(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture(scope="module")
def view(calm: Scenario, camera: int) -> CameraView:
    return CameraView(calm, camera, *SIZE, RATE_HZ)


@pytest.fixture(scope="module")
def noisy(training: Scenario, camera: int) -> CameraView:
    return CameraView(training, camera, *SIZE, RATE_HZ)


def spread(spots: dict[str, list[float]], name: str) -> float:
    """Distance from a spot to its nearest neighbour, px."""
    return min(float(np.hypot(*np.subtract(spots[name], other))) for key, other in spots.items() if key != name)


def test_marker_centroids_are_true_over_the_whole_flight(view: CameraView, camera: int, known: dict[str, Any]) -> None:
    flight = [pulse for pulse in known["pulses"] if pulse.get("in_flight")]
    assert len(flight) > 25
    errors = []
    for pulse in flight:
        picture, spots = image(view, pulse["pulse"]), pulse["images"][f"K{camera + 1}"]
        assert None not in spots.values(), "every camera sees the first 20 m of flight"
        for name, spot in spots.items():
            found = centroid(picture, spot, min(3.8, spread(spots, name) / 2))
            errors.append(float(np.hypot(*np.subtract(found, spot))))
    assert max(errors) < 0.02


def test_ball_centroids_are_true(view: CameraView, camera: int, calm: Scenario, known: dict[str, Any]) -> None:
    picture, spots = image(view, 0), known["ball_images"][f"K{camera + 1}"]
    assert len(spots) == 21
    projection = calm.cameras[camera].projection(*SIZE)
    for name, spot in spots.items():
        radius = calm.ball_radius_m * projection.c / float(projection.distance(known["balls"][name]["X"]))
        found = centroid(picture, spot, radius + PLATE_MARGIN_PX - 2.2)
        assert np.hypot(*np.subtract(found, spot)) < 0.02, name


def test_ski_lines_are_true(view: CameraView, camera: int, calm: Scenario, known: dict[str, Any]) -> None:
    """The visible middle of the near ski lies on the projected ski line, wherever nothing else is near."""
    projection, offsets = calm.cameras[camera].projection(*SIZE), []
    for pulse in known["pulses"]:
        if not pulse.get("in_flight"):
            continue
        picture, skis = image(view, pulse["pulse"]), pulse["skis"]
        right, left = (np.array((skis[side]["point"], skis[side]["direction"])) for side in ("right", "left"))
        other = projection.pixels([left[0] + s * left[1] for s in np.linspace(-1.3, 1.3, 60)])
        spots = np.array(list(pulse["images"][f"K{camera + 1}"].values()))
        for s in (-1.1, -0.9, 0.7, 0.9, 1.1):
            here, there = projection.pixels([right[0] + s * right[1], right[0] + (s + 0.1) * right[1]])
            if np.hypot(*(other - here).T).min() > 7 and np.hypot(*(spots - here).T).min() > 11:
                offsets.append(ridge_offset(picture, here, (there - here) / np.hypot(*(there - here))))
    assert len(offsets) > 10
    assert abs(np.median(offsets)) < 0.1
    assert np.abs(offsets).max() < 0.5  # trees behind the ski pull at so simple a measurement


def test_nothing_saturates(noisy: CameraView) -> None:
    assert max(int(image(noisy, pulse)[:-1].max()) for pulse in (0, 45, 60)) < 255


def test_noise_has_the_scenarios_sigma_on_background_and_jumper(
    training: Scenario, noisy: CameraView, view: CameraView, camera: int
) -> None:
    pulse = round(1.5 * RATE_HZ)
    difference = image(noisy, pulse).astype(float) - image(view, pulse)
    typical = 1.4826 * np.median(np.abs(difference - np.median(difference)))  # snow flakes are outliers
    assert typical == pytest.approx(training.image.noise_sigma, rel=0.2)
    spots = truth(training, [HillPulse(pulse)], RATE_HZ, SIZE)["pulses"][0]["images"][f"K{camera + 1}"]
    x, y = np.mean([spots["P1"], spots["P2"]], axis=0).astype(int)
    body = difference[y - 6 : y + 7, x - 6 : x + 7]
    assert 1.4826 * np.median(np.abs(body)) == pytest.approx(training.image.noise_sigma, rel=0.5)


def test_the_same_scenario_gives_the_same_images_in_any_order(
    training: Scenario, noisy: CameraView, camera: int
) -> None:
    again = CameraView(training, camera, *SIZE, RATE_HZ)
    expected = {pulse: image(noisy, pulse) for pulse in (3, 45, 60, 200)}
    for pulse in (200, 45, 3, 60):
        assert np.array_equal(image(again, pulse), expected[pulse])


def test_another_seed_gives_other_images(training: Scenario, noisy: CameraView, camera: int) -> None:
    other = CameraView(training.model_copy(update={"seed": 3}), camera, *SIZE, RATE_HZ)
    for pulse in (3, 45):
        assert (image(other, pulse) != image(noisy, pulse)).mean() > 0.5


def test_successive_images_differ(noisy: CameraView) -> None:
    assert all(not np.array_equal(image(noisy, p)[:-1], image(noisy, p + 1)[:-1]) for p in range(40, 60))


def test_every_image_is_stamped_unless_the_scenario_says_no(noisy: CameraView, calm: Scenario, camera: int) -> None:
    for pulse in (0, 45, 123_456_789):
        assert stamp.read(image(noisy, pulse)) == stamp.Stamp(camera, HillPulse(pulse))
    bare = CameraView(calm.model_copy(update={"stamp": False}), camera, *SIZE, RATE_HZ)
    assert stamp.read(image(bare, 7)) is None


def test_a_block_of_a_triplet_is_rendered_in_place(noisy: CameraView) -> None:
    triplet = np.full((480, 1920), 7, np.uint8)
    noisy.render_into(triplet[:, 640:1280], HillPulse(55))
    assert np.array_equal(triplet[:, 640:1280], image(noisy, 55))
    assert (triplet[:, :640] == 7).all()
    assert (triplet[:, 1280:] == 7).all()


def test_only_the_jumper_moves(view: CameraView, camera: int, known: dict[str, Any]) -> None:
    """Two images without noise and snow differ near the jumper and in the stamp alone."""
    pulse = next(p for p in known["pulses"] if p.get("since_takeoff_s", 0) > 0.4)
    changed = np.argwhere(image(view, pulse["pulse"])[:-1] != image(view, 0)[:-1])
    middle = np.mean(list(pulse["images"][f"K{camera + 1}"].values()), axis=0)[::-1]
    assert len(changed) > 200
    assert np.abs(changed - middle).max() < 90


@pytest.mark.parametrize("size", [(1936, 1216), (64, 48), (640, 100)])
def test_other_image_sizes_show_the_same_view(calm: Scenario, size: tuple[int, int]) -> None:
    view, pulse = CameraView(calm, 0, *size, RATE_HZ), round(1.4 * RATE_HZ)
    out = np.zeros(size[::-1], np.uint8)
    view.render_into(out, HillPulse(pulse))
    spot = truth(calm, [HillPulse(pulse)], RATE_HZ, size)["pulses"][0]["images"]["K1"]["P1"]
    if size[0] >= 640 and spot is not None:
        assert centroid(out, spot, 4.2 * size[0] / 640) == pytest.approx(spot, abs=0.02)
    assert stamp.read(out) == stamp.Stamp(0, HillPulse(pulse))


def test_a_camera_that_looks_away_shows_no_jumper(calm: Scenario) -> None:
    away = calm.cameras[0].model_copy(update={"look_at": (-60.0, -80.0, 5.0)})
    view = CameraView(calm.model_copy(update={"cameras": (away,)}), 0, *SIZE, RATE_HZ)
    assert np.array_equal(image(view, 50)[:-1], image(view, 0)[:-1])
