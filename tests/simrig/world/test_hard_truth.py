"""What the truth says beyond the bare jump: exposure, landmarks, centre of mass, take-off, cameras that move."""

import json
from typing import Any

import numpy as np
import pytest

from rig.pulse import HillPulse
from rig.settings.file import CONFIG
from simrig.world.figure.mass import LANDMARKS
from simrig.world.jumper import JumpSeries
from simrig.world.scenario import Scenario, load_scenario
from simrig.world.truth import truth
from tests.simrig.images.scenes import with_keys

RATE_HZ = 30.0
#: Members that the truth had from the beginning: readers rely on them.
_OF_A_PULSE = {
    "pulse", "time_s", "jumper_present", "jump", "since_takeoff_s", "in_flight", "points", "skis", "angles", "origin",
    "height", "velocity", "speed", "images",
}  # fmt: skip


@pytest.fixture(scope="module")
def hard() -> Scenario:
    return load_scenario(CONFIG / "scenarios" / "hard.toml")


@pytest.fixture(scope="module")
def known(hard: Scenario) -> dict[str, Any]:
    return truth(hard, map(HillPulse, range(20, 60)), RATE_HZ)


def test_the_truth_survives_json_and_keeps_its_members(known: dict[str, Any]) -> None:
    assert json.loads(json.dumps(known)) == known
    flying = [state for state in known["pulses"] if state.get("in_flight")]
    assert len(flying) > 20
    assert all(set(state) >= _OF_A_PULSE for state in flying)


def test_the_state_is_that_of_the_middle_of_the_exposure(training: Scenario) -> None:
    slow = with_keys(training, cameras={"exposure_us": 4000.0})
    blurred, sharp = (truth(s, [HillPulse(45)], RATE_HZ)["pulses"][0] for s in (slow, training))
    assert blurred["time_s"] == sharp["time_s"]
    assert blurred["state_s"] == pytest.approx(sharp["state_s"] + 2e-3)
    assert blurred["since_takeoff_s"] == pytest.approx(sharp["since_takeoff_s"] + 2e-3)
    assert blurred["middle_s"] == dict.fromkeys(("K1", "K2", "K3"), pytest.approx(1.502))
    assert blurred["points"]["P1"][0] - sharp["points"]["P1"][0] == pytest.approx(0.05, abs=0.005)
    assert blurred["images"]["K1"]["P1"] != sharp["images"]["K1"]["P1"]


def test_a_late_camera_is_late_in_its_own_images_alone(training: Scenario) -> None:
    content = training.model_dump()["cameras"]
    content[1]["late_ms"] = 8.0
    prompt = truth(training, [HillPulse(45)], RATE_HZ)["pulses"][0]
    other = truth(Scenario.model_validate({**training.model_dump(), "cameras": content}), [HillPulse(45)], RATE_HZ)
    state = other["pulses"][0]
    assert state["points"] == prompt["points"]
    assert state["images"]["K1"] == prompt["images"]["K1"]
    moved = np.subtract(state["images"]["K2"]["P2"], prompt["images"]["K2"]["P2"])
    assert 3 < np.hypot(*moved) < 12, "8 ms at 26 m/s"
    assert other["cameras"]["K2"]["late_ms"] == 8.0


def test_twelve_landmarks_make_a_body(known: dict[str, Any]) -> None:
    for state in known["pulses"]:
        if not state["jumper_present"]:
            continue
        named = {name: np.array(place) for name, place in state["landmarks"].items()}
        assert set(named) == {f"{side} {name}" for side in ("right", "left") for name in LANDMARKS}
        for side in ("right", "left"):
            shoulder, elbow, wrist, hip, knee, ankle = (named[f"{side} {name}"] for name in LANDMARKS)
            for a, b, least, most in (
                (shoulder, elbow, 0.2, 0.4), (elbow, wrist, 0.15, 0.35), (hip, knee, 0.4, 0.5), (knee, ankle, 0.4, 0.5),
            ):  # fmt: skip
                assert least < np.linalg.norm(a - b) < most
        middle = (named["right hip"] + named["left hip"]) / 2
        assert middle == pytest.approx(state["points"]["P2"], abs=1e-9)


def test_the_centre_of_mass_is_in_the_body_and_lower_with_skis(known: dict[str, Any], hard: Scenario) -> None:
    for state in known["pulses"]:
        if state["jumper_present"]:
            alone, together = (np.array(state["centre_of_mass"][key]) for key in ("body", "with_equipment"))
            assert np.linalg.norm(alone - state["points"]["P2"]) < 0.35
            assert np.linalg.norm(together - state["origin"]) < np.linalg.norm(alone - state["origin"])
            share = 2 * (hard.jumper.ski_mass_kg + hard.jumper.boot_mass_kg) / hard.jumper.mass_kg
            assert np.linalg.norm(together - alone) == pytest.approx(
                share * np.linalg.norm(alone - state["origin"]), rel=0.15
            )


def test_the_take_off_is_when_o_passes_the_edge(known: dict[str, Any], hard: Scenario) -> None:
    state = next(state for state in known["pulses"] if state.get("in_flight"))
    assert state["takeoff_pulse"] == pytest.approx(state["takeoff_s"] * RATE_HZ)
    there = JumpSeries(hard).at(state["takeoff_s"])
    assert there is not None
    assert there[0].origin(0.0)[0] == 0.0
    assert state["state_s"] - state["takeoff_s"] == pytest.approx(state["since_takeoff_s"])


def test_only_cameras_that_move_have_a_pose_of_each_pulse(training: Scenario, known: dict[str, Any]) -> None:
    assert all(set(state["poses"]) == {"K1", "K2", "K3"} for state in known["pulses"])
    for pose in known["pulses"][0]["poses"].values():
        R = np.array(pose["R"])  # noqa: N806
        assert pytest.approx(np.eye(3), abs=1e-12) == R.T @ R
    assert truth(training, [HillPulse(45)], RATE_HZ)["pulses"][0]["poses"] == {}


def test_markers_nobody_wears_are_not_visible(hard: Scenario) -> None:
    states = truth(hard, map(HillPulse, range(280, 300)), RATE_HZ)["pulses"]
    third = [state for state in states if state.get("jump") == 2]
    assert len(third) > 10
    assert not any(shares["P2"] for state in third for shares in state["visible"].values())
    assert any(shares["P1"] for state in third for shares in state["visible"].values())
