"""Live and whole: a jump in pictures that no part of Svev has made."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.result.model import Status
from analysis.worker.live import LiveAnalysis
from analysis.worker.stream import Received
from bench.corpus.drawn_hill import DrawnHill
from tests.analysis.candidates.judge import scenario
from tests.analysis.worker.found import Found

pytestmark = pytest.mark.long

PULSES = range(75)
LARGEST_M = 0.02  # in each coordinate
#: Mean square of error over sigma of slopes and headings; with one width for both skis of a V it is 3.2.
SKI_SQUARES = 1.6
CLEAR = 0.75  # share of a marker that is in sight; less is not drawn


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> tuple[DrawnHill, Found]:
    """The hill, and what was found in its pictures."""
    hill, found = DrawnHill(scenario(), PULSES, seed=1), Found()
    survey = tmp_path_factory.mktemp("drawn") / Path("survey.json")
    survey.write_text(json.dumps(hill.survey()))
    with LiveAnalysis(survey, None, found) as worker:
        for tag, image in hill.triplets():
            worker.take(Received(tag, image))
    return hill, found


def _in_clear_sight(state: dict[str, Any]) -> set[str]:
    """The markers that two cameras or more show."""
    shown = [
        label
        for of_camera, inside in zip(state["visible"].values(), state["in_sight"].values(), strict=True)
        for label, share in of_camera.items()
        if share > CLEAR and inside[label]
    ]
    return {label for label in shown if shown.count(label) > 1}


def test_he_is_followed_with_all_markers_that_are_in_sight(drawn: tuple[DrawnHill, Found]) -> None:
    hill, found = drawn
    assert not [said for said in found.said if said.startswith(("error", "warning"))]
    known = dict(enumerate(hill.known.values(), start=1))
    squares, measured, clear = [], 0, sum(len(_in_clear_sight(state)) for state in known.values() if "points" in state)
    for state in found.states:
        truth = known[state.pulse]
        for label, point in state.points.items():
            if "points" not in truth or point is None or point.status == Status.PREDICTED:
                continue
            off = np.array(point.X) - truth["points"][label]
            assert np.abs(off).max() < LARGEST_M
            squares.append(off @ np.linalg.solve(np.array(point.covariance), off) / 3)
            measured += label in _in_clear_sight(truth)
    assert measured > 0.9 * clear
    assert np.mean(squares) < 1.2


def test_the_whole_jump_is_measured_as_its_sigmas_say(drawn: tuple[DrawnHill, Found]) -> None:
    hill, found = drawn
    (measured,) = found.jumps
    (jump,) = measured.result.jumps
    assert jump.verdict.ok, jump.verdict.message
    known = dict(enumerate(hill.known.values(), start=1))
    squares, near, slopes, of_skis, seen = list[float](), list[bool](), list[float](), list[float](), 0
    for pulse in jump.pulses:
        truth = known[pulse.pulse]
        for label, point in pulse.raw.points.items():
            if "points" not in truth or point is None:
                continue
            off = point.xyz - truth["points"][label]
            squares.append(float(off @ np.linalg.solve(point.covariance, off) / 3))
            near.append(bool(np.abs(off).max() < LARGEST_M))
            seen += label in _in_clear_sight(truth)
        for side, ski in pulse.raw.skis.items():
            if "skis" in truth and ski is not None:
                x, y, z = truth["skis"][side]["direction"]
                off = np.array(
                    (ski.slope.value - np.degrees(np.arcsin(z)), ski.heading.value - np.degrees(np.arctan2(y, x)))
                )
                slopes.append(abs(float(off[0])))
                of_skis += ((off / (ski.slope.sigma, ski.heading.sigma)) ** 2).tolist()
    clear = sum(len(_in_clear_sight(state)) for state in known.values() if "points" in state)
    assert seen >= 0.98 * clear
    assert np.mean(near) > 0.95
    assert np.mean(squares) < 1.2
    assert len(slopes) > 40
    assert np.quantile(slopes, 0.9) < 0.3
    assert np.mean(of_skis) < SKI_SQUARES
