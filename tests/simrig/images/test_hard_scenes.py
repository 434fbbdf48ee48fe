"""Whole scenes: the hard day as it is shipped, and hills with other numbers of cameras, sides, sizes and rates."""

import hashlib
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from rig.errors import BadInputError
from rig.pulse import HillPulse
from rig.settings.file import CONFIG
from rig.settings.strict_toml import validate
from simrig.world.scenario import Scenario, load_scenario
from simrig.world.truth import truth
from tests.simrig.images.measuring import centroid
from tests.simrig.images.scenes import RATE_HZ, Renderer, with_keys

PULSES = (3, 34, 45, 52, 170)


@pytest.fixture(scope="module")
def hard() -> Scenario:
    return load_scenario(CONFIG / "scenarios" / "hard.toml")


def digests(camera: int, pulses: Sequence[int]) -> list[str]:
    image = Renderer(load_scenario(CONFIG / "scenarios" / "hard.toml"), camera)
    return [hashlib.sha256(image(pulse).tobytes()).hexdigest() for pulse in pulses]


def test_the_same_pulse_gives_the_same_image_in_whichever_process_and_order() -> None:
    backwards = PULSES[::-1]
    code = f"from {__name__} import digests; print(*digests(1, {backwards}))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=CONFIG.parent, capture_output=True, text=True, timeout=60, check=True
    )
    assert digests(1, PULSES) == done.stdout.split()[::-1]


def test_another_seed_gives_another_day(hard: Scenario) -> None:
    other = hard.model_copy(update={"seed": 4})
    assert (Renderer(other)(45) != Renderer(hard)(45)).mean() > 0.5


@pytest.mark.parametrize("camera", [0, 1, 2])
def test_on_the_hard_day_markers_in_sight_can_still_be_measured(hard: Scenario, camera: int) -> None:
    """Flakes and glare spoil some; the typical error stays far below a pixel, and nothing is biased."""
    image, errors = Renderer(hard, camera, rate_hz=30.0), []
    for state in truth(hard, map(HillPulse, range(35, 54)), 30.0)["pulses"]:
        name = f"K{camera + 1}"
        picture = image(state["pulse"])
        for marker in ("P1", "P2"):
            if state["visible"][name][marker] == 1.0:
                spot = state["images"][name][marker]
                errors.append(np.subtract(centroid(picture, spot, 3.3), spot))
    assert len(errors) > 20
    assert np.median(np.hypot(*np.array(errors).T)) < 0.25
    assert np.abs(np.median(errors, axis=0)).max() < 0.12


def test_the_hard_day_is_the_training_session_otherwise(hard: Scenario, training: Scenario) -> None:
    assert [ball.X for ball in hard.balls] == [ball.X for ball in training.balls]
    assert [camera.X0 for camera in hard.cameras] == [camera.X0 for camera in training.cameras]
    assert hard.jumper.takeoff_speed_m_s == training.jumper.takeoff_speed_m_s


def ring(calm: Scenario, count: int) -> Scenario:
    """Cameras on both sides of the hill, in turns."""
    cameras = [
        {
            "name": f"C{k + 1}", "c": 1300.0 + 20 * k, "look_at": (9.0, 0.0, -2.5),
            "X0": (-22.0 + 9.0 * k, -31.0 if k % 2 == 0 else 33.0, 6.0 + k),
        }
        for k in range(count)
    ]  # fmt: skip
    return Scenario.model_validate({**calm.model_dump(), "cameras": cameras})


@pytest.mark.parametrize(("count", "size", "rate_hz"), [(2, (1936, 1216), 200.0), (8, (640, 480), 60.0)])
def test_cameras_on_both_sides_see_the_same_jumper(
    calm: Scenario, count: int, size: tuple[int, int], rate_hz: float
) -> None:
    scenario = with_keys(ring(calm, count), jumper={"occlusion": True})
    pulse = round(1.45 * rate_hz)
    state = truth(scenario, [HillPulse(pulse)], rate_hz, size)["pulses"][0]
    assert len(state["images"]) == count
    for k, spots in enumerate(state["images"].values()):
        picture = Renderer(scenario, k, size, rate_hz)(pulse)
        projection = scenario.cameras[k].projection(*size)
        distance = float(projection.distance(state["points"]["P1"]))
        reach = scenario.jumper.marker_radius_m * projection.c / distance + 1.8
        assert np.hypot(*np.subtract(centroid(picture, spots["P1"], reach), spots["P1"])) < 0.2
    rays = [state["in_sight"][name]["P1"] for name in state["images"]]
    assert sum(rays) == count


def test_a_camera_on_the_left_has_forest_trees_and_flags_across_the_hill(calm: Scenario) -> None:
    """Nothing of them is in front of the balls, on whichever side the camera stands."""
    full = with_keys(ring(calm, 2), surroundings={"trees": 30, "flags": 10})
    for camera, name in enumerate(("C1", "C2")):
        picture = Renderer(full, camera)(0)
        for spot in truth(full, [], RATE_HZ)["ball_images"][name].values():
            if spot is not None and 12 < spot[0] < 627 and 12 < spot[1] < 467:
                assert picture[round(spot[1]), round(spot[0])] > 200


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"light": {"cloud_depth": 2.0}}, "cloud_depth"),
        ({"light": {"clouds": 0.1}}, 'unknown key "light.clouds"'),
        ({"weather": {"snowfall": -0.1}}, "snowfall"),
        ({"jumper": {"missing_markers": [{"marker": "P9"}]}}, "missing_markers"),
        ({"image": {"electrons_per_grey": 0.5}}, "saturates"),
    ],
)
def test_a_wrong_effect_is_refused_in_one_line(calm: Scenario, keys: dict[str, Any], words: str) -> None:
    content = calm.model_dump(mode="json")
    for table, values in keys.items():
        content[table] |= values
    with pytest.raises(BadInputError) as raised:
        validate(Scenario, content, CONFIG / "scenarios" / "hard.toml")
    assert words in str(raised.value)
    assert "\n" not in str(raised.value)
