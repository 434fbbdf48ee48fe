"""A jumper without markers is measured with few clicks: a start by hand, the rest is followed in the images."""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from analysis.digitizing.desk import Desk
from bench.analysis.hill_logs import HillLog
from rig.api.digitizing import Action, MarkState, PlaceAction, StateAction, TrackOrder
from rig.arrays import Floats
from tests.analysis.digitizing.hill import clicks, followed, opened, placed, rendered_jump

START, PULSES = 20, range(13, 33)
#: Before these he is on the table, where skis cover each other: what is followed there holds, but not all of it is.
ON_TABLE = range(8, 13)
THINGS = ["P1", "P2", "P3", "P4", "right ski", "left ski"]


@pytest.mark.long
def test_twenty_pulses_in_the_air_take_less_than_sixty_clicks(tmp_path: Path) -> None:
    log = placed(rendered_jump(markers=False, seed=111), tmp_path)
    desk = opened(log)
    made: list[Action] = [click.action() for click in clicks(desk, log, 111, range(START, START + 1), markers=False)]
    made += _states([action for action in made if isinstance(action, PlaceAction)])
    assert len(made) < 60
    for action in made:
        desk.session("Anna").act(action)
    for direction, most in ((1, PULSES[-1] - START), (-1, START - ON_TABLE[0])):
        followed(desk, "Anna", TrackOrder(things=THINGS, pulse=START, direction=direction, most=most))
    _states_stand(desk)
    _each_point_says_how_sure_it_is(desk)
    points, skis = _errors(desk, log, PULSES)
    assert sum(map(len, points.values())) >= 0.95 * 4 * len(PULSES)
    assert sum(map(len, skis.values())) >= 0.9 * 2 * len(PULSES)
    assert 0.5 < _rms(np.concatenate(list(points.values()))) < 1.5  # errors of one start are shared by all its pulses
    for of in skis.values():
        assert 0.4 < _rms(np.array(of)) < 2.0  # of one ski, likewise: about four that are independent
    on_table, its_skis = _errors(desk, log, ON_TABLE)
    for kind in (points, on_table, skis, its_skis):
        assert all(np.abs(errors).max() < 5 for errors in kind.values())
    desk.close()


def _each_point_says_how_sure_it_is(desk: Desk) -> None:
    """A point in space is controlled by a third ray, or says that it is not; without a place it says why."""
    for pulse in PULSES:
        for name, point in desk.view("Anna", pulse).space.items():
            if point.X is not None:
                assert point.status == {2: "two rays", 3: "controlled"}[len(point.rays)], (pulse, name)
            else:
                assert point.status not in {"", "two rays", "controlled"}, (pulse, name)


def _errors(desk: Desk, log: HillLog, pulses: range) -> tuple[dict[str, list[Floats]], dict[str, list[float]]]:
    """Errors over their sigmas: of points (n, 3), of the slopes of skis (n,), by name."""
    points, skis = defaultdict[str, list[Floats]](list), defaultdict[str, list[float]](list)
    for pulse in pulses:
        view, truth = desk.view("Anna", pulse), log.truth[pulse]
        for name, point in view.space.items():
            if point.X is not None:
                points[name].append(np.subtract(point.X, truth["points"][name]) / point.sigma)
        for name, line in view.lines.items():
            if line.slope is not None:
                true = np.degrees(np.arcsin(truth["skis"][name.partition(" ")[0]]["direction"][2]))
                skis[name].append((line.slope.value - true) / line.slope.sigma)
    return points, skis


def _rms(errors: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


def _states(made: Sequence[PlaceAction]) -> list[Action]:
    """He says of three points in other pulses that they are hidden, not visible, or where he guesses one."""
    x, y = next(action.xy for action in made if (action.camera, action.thing) == ("K3", "P4"))
    guess = PlaceAction(do="place", pulse=START + 4, camera="K3", thing="P4", xy=(x + 30, y), state=MarkState.GUESS)
    return [
        StateAction(do="state", pulse=START + 2, camera="K2", thing="P2", state=MarkState.HIDDEN),
        StateAction(do="state", pulse=START + 3, camera="K1", thing="P1", state=MarkState.NOT_VISIBLE),
        guess,
    ]


def _states_stand(desk: Desk) -> None:
    """What he said of points stands, and nothing is computed from it; each other place says how it came about."""
    coverage = desk.session_view("Anna").coverage
    for pulse, camera, thing, letter in ((22, "K2", "P2", "h"), (23, "K1", "P1", "n"), (24, "K3", "P4", "g")):
        assert coverage[thing][camera][pulse] == letter
        rays = desk.view("Anna", pulse).space[thing].rays
        assert camera not in rays
        assert len(rays) == 2
    said = {letter for cameras in coverage.values() for pulses in cameras.values() for letter in pulses.values()}
    assert said == set("mthng")
    for cameras in coverage.values():
        for pulses in cameras.values():
            assert pulses.get(START, "m") == "m"  # where he measured, nothing was followed over it
