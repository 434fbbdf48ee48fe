import json
from typing import Any

import numpy as np
import pytest

from rig.pulse import HillPulse
from simrig.world.scenario import Scenario
from simrig.world.truth import truth

RATE_HZ = 30.0


@pytest.fixture(scope="module")
def known(training: Scenario) -> dict[str, Any]:
    return truth(training, map(HillPulse, range(150)), RATE_HZ)


def test_the_truth_survives_json(known: dict[str, Any]) -> None:
    assert json.loads(json.dumps(known)) == known


def test_cameras_follow_the_network_file(known: dict[str, Any]) -> None:
    """Eq. (A1), written out once more from the contract, reproduces every pixel coordinate."""
    checked = 0
    for pulse in known["pulses"]:
        for name, camera in known["cameras"].items():
            r1, r2, r3 = np.array(camera["R"]).T
            width, height = camera["size"]
            for marker, pixel in pulse.get("images", {}).get(name, {}).items():
                d = np.array(pulse["points"][marker]) - camera["X0"]
                x = -camera["c"] * (d @ r1) / (d @ r3) + (width - 1) / 2
                y = (height - 1) / 2 + camera["c"] * (d @ r2) / (d @ r3)
                if pixel is None:
                    assert not (0 <= x <= width - 1 and 0 <= y <= height - 1)
                else:
                    assert pixel == pytest.approx([x, y])
                    checked += 1
    assert checked > 200


def test_every_pulse_is_there_and_says_whether_somebody_jumps(known: dict[str, Any]) -> None:
    assert [pulse["pulse"] for pulse in known["pulses"]] == list(range(150))
    present = [pulse["pulse"] for pulse in known["pulses"] if pulse["jumper_present"]]
    flying = [pulse["pulse"] for pulse in known["pulses"] if pulse.get("in_flight")]
    assert 30 in flying
    assert 23 <= len(flying) <= 26
    assert set(flying) < set(present)
    assert 90 not in present
    assert known["pulses"][31]["time_s"] == pytest.approx(31 / 30)


def test_speed_is_what_the_origins_moved(known: dict[str, Any]) -> None:
    flight = [pulse for pulse in known["pulses"] if pulse.get("in_flight")]
    for before, here, after in zip(flight[2:], flight[3:], flight[4:], strict=False):
        moved = (np.array(after["origin"]) - before["origin"]) * RATE_HZ / 2
        assert here["velocity"] == pytest.approx(moved, abs=0.1)
        assert here["speed"] == pytest.approx(float(np.linalg.norm(here["velocity"])))
        assert here["height"] == here["origin"][2]


def test_the_origin_is_the_middle_of_p3_and_p4(known: dict[str, Any]) -> None:
    here = known["pulses"][40]
    middle = (np.array(here["points"]["P3"]) + here["points"]["P4"]) / 2
    assert here["origin"] == pytest.approx(middle.tolist())
    assert here["skis"]["right"]["point"] == here["points"]["P3"]
    assert here["points"]["P4"][1] > here["points"]["P3"][1]


def test_balls_have_their_roles_and_places(known: dict[str, Any], training: Scenario) -> None:
    assert {name: ball["role"] for name, ball in known["balls"].items()} == {b.name: b.role for b in training.balls}
    assert all(None not in spots.values() for spots in known["ball_images"].values())


def test_every_jump_of_the_session_is_in_sight_of_every_camera(training: Scenario) -> None:
    known = truth(training, map(HillPulse, range(0, 1200, 3)), RATE_HZ)
    flying = [pulse for pulse in known["pulses"] if pulse.get("in_flight")]
    assert {pulse["jump"] for pulse in flying} == set(range(10))
    for pulse in flying:
        for spots in pulse["images"].values():
            assert None not in spots.values()
            assert np.hypot(*np.subtract(spots["P3"], spots["P4"])) > 7  # so that both can be measured
