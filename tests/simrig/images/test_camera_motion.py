from typing import Any

import numpy as np
import pytest

from rig.pulse import HillPulse
from simrig.world.conditions.camera_motion import CameraMotion
from simrig.world.scenario import Scenario
from simrig.world.truth import truth
from tests.simrig.images.measuring import centroid
from tests.simrig.images.scenes import RATE_HZ, SIZE, Renderer, with_keys

KNOCK = {"from_s": 1.5, "rotation_deg": (0.1, -0.05, 0.2), "shift_m": (0.1, 0.0, -0.05)}
DRIFT = {"from_s": 1.0, "until_s": 3.0, "rotation_deg": (0.0, 0.2, 0.0)}


def moved(known: dict[str, Any], state: dict[str, Any], name: str, X: list[float]) -> np.ndarray[Any, Any]:  # noqa: N803
    """Pixel coordinates by Eq. (A1) from the pose that the truth gives for a pulse."""
    camera = {**known["cameras"][name], **state["poses"].get(name, {})}
    k = np.array(camera["R"]).T @ (np.array(X) - camera["X0"])
    width, height = camera["size"]
    middle = np.array(((width - 1) / 2, (height - 1) / 2))
    return np.asarray(middle + camera["c"] * np.array((-k[0], k[1])) / k[2])


@pytest.mark.parametrize(
    "keys", [{"moves": [KNOCK]}, {"moves": [DRIFT]}, {"shake_deg": 0.03}, {"moves": [KNOCK, DRIFT]}]
)
def test_balls_and_markers_are_where_the_moved_camera_sees_them(calm: Scenario, keys: dict[str, Any]) -> None:
    scenario = with_keys(calm, cameras=keys)
    pulses = [HillPulse(pulse) for pulse in (40, 60, 66)]
    known, image = truth(scenario, pulses, RATE_HZ), Renderer(scenario)
    away = []
    for pulse, state in zip(pulses, known["pulses"], strict=True):
        picture = image(pulse)
        for ball in ("B2", "B7", "B11", "T5"):
            spot = moved(known, state, "K1", known["balls"][ball]["X"])
            away.append(float(np.hypot(*(spot - known["ball_images"]["K1"][ball]))))
            found = centroid(picture, spot.tolist(), 4.5)
            assert np.hypot(*(np.array(found) - spot)) < 0.03
        spot = state["images"]["K1"]["P1"]
        assert spot == pytest.approx(moved(known, state, "K1", state["points"]["P1"]).tolist(), abs=1e-6)
        assert np.hypot(*np.subtract(centroid(picture, spot, 3.5), spot)) < 0.05
    assert max(away) > 0.4


def test_the_hill_moves_with_the_camera(calm: Scenario) -> None:
    """After a turn about r2 the picture lies beside where it was."""
    turned = Renderer(with_keys(calm, cameras={"moves": [{"from_s": 1.0, "rotation_deg": (0.0, 0.2, 0.0)}]}))(99)
    plain, shift = Renderer(calm)(99).astype(float), 1419.7 * np.tan(np.radians(0.2))
    lag = [
        float(np.corrcoef(turned[100:400, 50:550].ravel(), plain[100:400, 50 + d : 550 + d].ravel())[0, 1])
        for d in range(-8, 9)
    ]
    assert abs(abs(int(np.argmax(lag)) - 8) - shift) < 0.6
    assert max(lag) > 0.95


def test_a_knock_is_at_once_a_drift_is_slow_and_both_stay(calm: Scenario) -> None:
    scenario = with_keys(calm, cameras={"moves": [KNOCK]})
    still = scenario.cameras[0].projection(*SIZE)
    knocked = CameraMotion(scenario, 0)
    assert np.array_equal(knocked.at(still, 1.4999).R, still.R)
    shift = knocked.at(still, 1.5).X0 - still.X0
    assert shift == pytest.approx((0.1, 0.0, -0.05))
    assert np.array_equal(knocked.at(still, 1.5).R, knocked.at(still, 99.0).R)
    drifting = CameraMotion(with_keys(calm, cameras={"moves": [DRIFT]}), 0)
    turns = [np.degrees(np.arccos((np.trace(still.R.T @ drifting.at(still, t).R) - 1) / 2)) for t in (0.5, 2, 3, 50)]
    assert turns == pytest.approx([0.0, 0.1, 0.2, 0.2], abs=1e-6)


def test_shake_has_the_scenarios_size(calm: Scenario) -> None:
    scenario = with_keys(calm, cameras={"shake_deg": 0.02})
    still, motion = scenario.cameras[1].projection(*SIZE), CameraMotion(scenario, 1)
    far = still.X0 - 50 * still.R[:, 2]
    spots = np.array([motion.at(still, t).pixels(far) for t in np.arange(0, 60, 0.01)])
    assert spots.std(axis=0) == pytest.approx([still.c * np.radians(0.02)] * 2, rel=0.1)
    assert not CameraMotion(scenario, 1).still
    assert CameraMotion(calm, 1).still
