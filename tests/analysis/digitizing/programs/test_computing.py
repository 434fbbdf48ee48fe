"""A program of its own computes: it stands still for a recording, can be cancelled, and is told if it is killed."""

import os
import re
import signal
from pathlib import Path

from analysis.digitizing.desk import Desk
from analysis.digitizing.files import DeskFiles
from bench.analysis.hill_logs import HillLog
from rig.api.digitizing import HandResult
from tests.analysis.digitizing.hill import Oriented, adopt, clicks
from tests.support.waiting import wait_until


def test_computing_stands_still_while_a_recording_runs_and_can_be_cancelled(jump: HillLog, desk: Desk) -> None:
    files = DeskFiles(jump.path, jump.path.with_suffix(".digitized"), jump.path.with_suffix(".measured"))
    waiting = Desk(files, lambda: None, busy=lambda: True)
    adopt(waiting, Oriented.of(desk))
    for click in clicks(desk, jump, 3, range(18, 21)):
        waiting.act("Anna", click.action())
    assert waiting.programs.compute("Anna").state == "computing"
    wait_until(lambda: waiting.programs.computing.result("Anna").paused, "it stands still", 20)
    child = _child()
    assert waiting.programs.computing.cancel("Anna") == HandResult(state="none")
    wait_until(lambda: not Path(f"/proc/{child}").exists(), "the program has ended", 20)
    assert waiting.programs.compute("Anna").state == "computing"
    waiting.close()
    assert [path.name for path in files.folder.iterdir()] == ["Anna.jsonl"]


def test_a_program_that_was_killed_is_told(jump: HillLog, desk: Desk) -> None:
    for click in clicks(desk, jump, 3, range(18, 21)):
        desk.act("Anna", click.action())
    desk.programs.compute("Anna")
    wait_until(lambda: _child() is not None, "the program runs", 20)
    os.kill(_child() or 0, signal.SIGKILL)
    wait_until(lambda: desk.programs.computing.result("Anna").state == "failed", "it is told", 20)
    problem = desk.programs.computing.result("Anna").problem
    assert problem is not None
    assert problem.code == "errand_ended"
    assert [path.name for path in desk.files.folder.iterdir()] == ["Anna.jsonl"]


def _child() -> int | None:
    """The program that computes for this process."""
    for status in Path("/proc").glob("[0-9]*/status"):
        try:
            parent = re.search(r"^PPid:\t(\d+)$", status.read_text(), re.MULTILINE)
            command = (status.parent / "cmdline").read_bytes()
        except OSError:
            continue
        if parent and int(parent[1]) == os.getpid() and b"computing_program" in command:
            return int(status.parent.name)
    return None
