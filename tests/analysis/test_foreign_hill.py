"""The foreign hill is fit to judge by: balls and jumper are in sight, its surveyor sees what its truth says."""

import numpy as np
import pytest

from photogrammetry.geometry.camera_model import INTERIOR, Lens, image_point
from rig.pulse import HillPulse
from simrig.world.truth import truth
from tests.analysis.foreign_hill import RATE_HZ, SIZE, foreign, survey_json, surveyed, surveyed_camera


def test_all_balls_and_the_whole_flight_are_in_sight_of_several_cameras() -> None:
    known = truth(foreign(), map(HillPulse, range(100, 240, 3)), RATE_HZ, SIZE)
    assert not foreign().stamp
    for shares in known["ball_visible"].values():
        assert set(shares.values()) == {1.0}
    states = [state for state in known["pulses"] if state.get("in_flight")]
    assert len(states) > 25
    for marker in ("P1", "P2", "P3", "P4"):
        seeing = [sum(seen[marker] for seen in state["in_sight"].values()) for state in states]
        assert min(seeing) >= 1
        assert np.mean(np.array(seeing) >= 2) > 0.95, "in two images in nearly every pulse"


def test_the_surveyors_cameras_see_what_the_truth_says() -> None:
    known, survey = truth(foreign(), [HillPulse(175)], RATE_HZ, SIZE), survey_json(seed=1, sigma=0.0)
    balls = np.array([ball["X"] for ball in known["balls"].values()])
    for camera in foreign().cameras:
        entry = survey["cameras"][camera.name]
        lens = Lens(np.array([entry[key] for key in INTERIOR]), np.array(entry["r0"]), np.array(False))
        X0, R = surveyed_camera(camera.projection(*SIZE))  # noqa: N806
        metric = image_point(lens, R, X0, surveyed(balls))
        pixels = np.stack(((SIZE[0] - 1) / 2 + metric[:, 0], (SIZE[1] - 1) / 2 - metric[:, 1]), axis=1)
        assert pixels == pytest.approx(np.array(list(known["ball_images"][camera.name].values())), abs=1e-6)
    control = [point["X"] for point in survey["points"].values() if point["role"] == "control"]
    assert len(control) == 14
    assert np.hypot(*np.ptp(np.array(control), axis=0)[:2]) < 40
