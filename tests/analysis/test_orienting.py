"""Cameras that are knocked during a recording are oriented from the time in which they stood still."""

import numpy as np
import pytest

from analysis.procedure.orienting import oriented
from rig.pulse import HillPulse
from simrig.world.conditions.camera_motion import CameraMotion
from tests.analysis.cameras.moving_hill import Film, moving
from tests.analysis.scene.hill import RATE_HZ, SIZE, survey_json, survey_of, training


@pytest.mark.long
def test_the_balls_of_a_knocked_camera_are_measured_where_they_were_for_the_longest_time() -> None:
    film = Film(moving("K2", moves=[{"from_s": 1.4, "rotation_deg": (0.03, 0.04, 0.0)}]), 60)
    survey = survey_of(survey_json(training(), 1))
    found = oriented(film.static(), survey, film, lambda name, pulses: film.static(pulses=pulses)[name])
    still = found.steadiness.still["K2"]
    index = film.scenario.camera_index("K2")
    settings = film.scenario.cameras[index]
    at = CameraMotion(film.scenario, index).at(
        settings.projection(*SIZE), settings.middle_s(HillPulse(still[len(still) // 2]), RATE_HZ)
    )
    off = {
        ball.name: known.images["K2"][:2] - at.pixels(np.array(ball.X))
        for ball in film.scenario.balls
        if (known := found.scene.balls.get(ball.name)) is not None and "K2" in known.images
    }
    assert len(off) > 12
    error = np.array(list(off.values()))
    assert np.abs(error.mean(axis=0)).max() < 0.02, "px; a median over both poses is off by a tenth"
    assert [move.camera for move in found.steadiness.moved] == ["K2"]
