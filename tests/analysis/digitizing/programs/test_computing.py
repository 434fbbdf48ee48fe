"""A program of its own computes: it stands still for a recording, can be cancelled, and is told if it is killed."""

import os
import re
import signal
from pathlib import Path

import numpy as np
import pytest

from analysis.digitizing.desk import Desk
from analysis.digitizing.files import DeskFiles
from bench.analysis.hill_logs import HillLog
from rig.api.digitizing import HandCurves, HandResult
from tests.analysis.digitizing.hill import PATIENCE_S, Oriented, adopt, clicks
from tests.support.waiting import wait_until


def test_computing_stands_still_while_a_recording_runs_and_can_be_cancelled(jump: HillLog, desk: Desk) -> None:
    files = DeskFiles(jump.path, jump.path.with_suffix(".digitized"), jump.path.with_suffix(".measured"))
    waiting = Desk(files, lambda: None, busy=lambda: True)
    adopt(waiting, Oriented.of(desk))
    for click in clicks(desk, jump, 3, range(18, 21)):
        waiting.act("Anna", click.action())
    assert waiting.programs.compute("Anna").state == "computing"
    wait_until(lambda: waiting.programs.computing.result("Anna").paused, "it stands still")
    child = _child()
    assert waiting.programs.computing.cancel("Anna") == HandResult(state="none")
    wait_until(lambda: not Path(f"/proc/{child}").exists(), "the program has ended")
    assert waiting.programs.compute("Anna").state == "computing"
    waiting.close()
    assert [path.name for path in files.folder.iterdir()] == ["Anna.jsonl"]


def test_a_program_that_was_killed_is_told(jump: HillLog, desk: Desk) -> None:
    for click in clicks(desk, jump, 3, range(18, 21)):
        desk.act("Anna", click.action())
    desk.programs.compute("Anna")
    wait_until(lambda: _child() is not None, "the program runs")
    os.kill(_child() or 0, signal.SIGKILL)
    wait_until(lambda: desk.programs.computing.result("Anna").state == "failed", "it is told")
    problem = desk.programs.computing.result("Anna").problem
    assert problem is not None
    assert problem.code == "errand_ended"
    assert [path.name for path in desk.files.folder.iterdir()] == ["Anna.jsonl"]


@pytest.mark.long
@pytest.mark.alone
@pytest.mark.timeout(3 * PATIENCE_S)
def test_curves_follow_the_newest_marks(jump: HillLog, desk: Desk) -> None:
    assert desk.programs.curves("Anna") == HandCurves(state="none"), "nothing is marked"
    for click in clicks(desk, jump, 3, range(12, 13)):
        desk.act("Anna", click.action())
    short = _followed(desk)
    assert not short.curves
    assert "nothing to smooth" in "; ".join(map(str, short.said))
    for click in clicks(desk, jump, 3, range(13, 22)):
        desk.act("Anna", click.action())
    first = _followed(desk)
    assert first.revision == desk.session("Anna").revision
    assert {"alpha", "beta", "gamma", "dphi", "phi", "height", "speed"} <= first.curves.keys()
    errors = []
    for name in ("alpha", "phi", "height"):
        for point in first.curves[name]:
            truth = jump.truth[point.pulse]
            true = truth["height"] if name == "height" else truth["angles"][name]
            errors.append((point.value - true) / point.sigma)
    assert np.abs(errors).max() < 5
    for click in clicks(desk, jump, 3, range(22, 25)):
        desk.act("Anna", click.action())
        earlier = desk.programs.curves("Anna")
        assert earlier.curves, "those that are known stand until newer ones are there"
    newest = _followed(desk)
    assert newest.revision == desk.session("Anna").revision
    assert newest.curves["alpha"][-1].pulse == 24
    assert desk.programs.curves("Anna") == newest, "the same marks are not computed from again"


@pytest.mark.long
@pytest.mark.alone
@pytest.mark.timeout(2 * PATIENCE_S)
def test_curves_that_were_not_computed_are_told_and_asked_for_again_with_the_next_mark(
    jump: HillLog, desk: Desk
) -> None:
    some = list(clicks(desk, jump, 3, range(13, 21)))
    for click in some[:-1]:
        desk.act("Anna", click.action())
    desk.programs.curves("Anna")
    wait_until(lambda: _child("curves_program") is not None, "the program runs")
    assert os.sched_getscheduler(_child("curves_program") or 0) == os.SCHED_IDLE, "no click waits for it"
    os.kill(_child("curves_program") or 0, signal.SIGKILL)
    wait_until(lambda: desk.programs.curves("Anna").state == "failed", "it is told")
    assert _child("curves_program") is None
    desk.act("Anna", some[-1].action())
    assert _followed(desk).curves["alpha"]


def _followed(desk: Desk) -> HandCurves:
    """The curves of what is marked now."""
    wait_until(lambda: desk.programs.curves("Anna").state != "computing", "they are computed", PATIENCE_S)
    found = desk.programs.curves("Anna")
    assert found.state == "done", found.problem
    return found


def _child(program: str = "computing_program") -> int | None:
    """The program that computes for this process."""
    for status in Path("/proc").glob("[0-9]*/status"):
        try:
            parent = re.search(r"^PPid:\t(\d+)$", status.read_text(), re.MULTILINE)
            command = (status.parent / "cmdline").read_bytes()
        except OSError:
            continue
        if parent and int(parent[1]) == os.getpid() and program.encode() in command:
            return int(status.parent.name)
    return None
