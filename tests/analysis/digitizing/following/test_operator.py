"""A jumper without markers is measured with few clicks: a start by hand, the rest is followed in the images."""

from pathlib import Path

import numpy as np
import pytest

from bench.analysis.hill_logs import HillLog
from rig.api.digitizing import TrackOrder
from tests.analysis.digitizing.hill import clicks, followed, opened, write_jump

START, PULSES = 20, range(13, 33)
THINGS = ["P1", "P2", "P3", "P4", "right ski", "left ski"]


@pytest.mark.long
def test_twenty_pulses_in_the_air_take_less_than_sixty_clicks(tmp_path: Path) -> None:
    log: HillLog = write_jump(tmp_path, markers=False, seed=111)
    desk = opened(log)
    made = [click.action() for click in clicks(desk, log, 111, range(START, START + 1), markers=False)]
    assert len(made) < 60
    for action in made:
        desk.session("Anna").act(action)
    for direction, most in ((1, PULSES[-1] - START), (-1, START - PULSES[0])):
        followed(desk, "Anna", TrackOrder(things=THINGS, pulse=START, direction=direction, most=most))
    errors, points, lines = [], 0, 0
    for pulse in PULSES:
        view, truth = desk.view("Anna", pulse), log.truth[pulse]
        for name, point in view.space.items():
            if point.X is not None:
                errors.append(np.subtract(point.X, truth["points"][name]) / point.sigma)
                points += 1
        for name, line in view.lines.items():
            if line.slope is not None:
                true = np.degrees(np.arcsin(truth["skis"][name.partition(" ")[0]]["direction"][2]))
                assert abs(line.slope.value - true) < 5 * line.slope.sigma
                lines += 1
    assert points >= 0.95 * 4 * len(PULSES)
    assert lines >= 0.9 * 2 * len(PULSES)
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.5  # errors of one start are shared by all its pulses
    assert np.abs(errors).max() < 5
    desk.close()
