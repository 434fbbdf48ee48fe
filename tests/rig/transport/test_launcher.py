"""What the launcher forks is like what a command line starts: parent, name, exit code, descriptors; also without it."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from rig.transport.launcher import Launched, Launcher, Process, end_launcher, launcher, start_program
from tests.support.waiting import wait_until

PROGRAM = "tests.rig.transport.telling_process"


@pytest.fixture(params=["forked", "by its command line"])
def more(request: pytest.FixtureRequest) -> dict[str, str]:
    """Variables that have a program forked by the launcher, or started otherwise."""
    return {} if request.param == "forked" else {"LD_BIND_NOW": "1"}


def _start(what: str, more: dict[str, str], output: Path, *inherit: int) -> Process:
    with output.open("wb") as file:
        return start_program(PROGRAM, (what, *map(str, inherit)), inherit, more, own_group=False, output=file.fileno())


def test_parent_name_arguments_and_folder_are_those_of_a_program(
    more: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    process = _start("facts", more, tmp_path / "out")
    assert process.wait(20) == 0
    assert isinstance(process, Launched) == (not more)
    said = dict(line.split("=", 1) for line in (tmp_path / "out").read_text().splitlines())
    command = [sys.executable, "-P", "-m", PROGRAM, "facts"]
    assert said == {
        "parent": str(os.getpid()), "shown": repr(command), "argv": "['facts']", "folder": str(tmp_path),
        "group": str(os.getpgrp()), "ignores Ctrl-C": str(bool(more) and _ignored(signal.SIGINT)), "threads": "1",
    }  # fmt: skip


def test_it_has_the_environment_of_now_and_variables_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SVEV_TEST_NOW", "1")
    process = _start("environment", {"SVEV_TEST_OWN": "2"}, tmp_path / "out")
    assert process.wait(20) == 0
    assert isinstance(process, Launched)
    assert (tmp_path / "out").read_text() == "[('SVEV_TEST_NOW', '1'), ('SVEV_TEST_OWN', '2')]\n"
    monkeypatch.setenv("LD_BIND_NOW", "1")
    assert isinstance(plain := _start("ends", {}, tmp_path / "out"), subprocess.Popen)
    assert plain.wait(20) == 7


def _ignored(number: signal.Signals) -> bool:
    """Whether this process ignores a signal, as one does that a shell has put into the background."""
    return signal.getsignal(number) is signal.SIG_IGN


@pytest.mark.parametrize(("what", "code"), [("ends", 7), ("fails", 1), ("killed", -signal.SIGKILL)])
def test_its_end_is_known_by_its_code(more: dict[str, str], tmp_path: Path, what: str, code: int) -> None:
    process = _start(what, more, tmp_path / "out")
    assert process.wait(20) == code
    assert process.poll() == code
    assert ("ZeroDivisionError" in (tmp_path / "out").read_text()) == (what == "fails")
    process.kill()  # nobody is there any more, and nothing happens


def test_at_its_end_nothing_is_left_undone(more: dict[str, str], tmp_path: Path) -> None:
    """Threads are awaited, what was registered is called, and what was said is written."""
    process = _start("leaves", more, tmp_path / "out")
    assert process.wait(20) == 1
    said = (tmp_path / "out").read_text().splitlines()
    said.remove("a text instead of a code")
    assert said == ["main has ended", "the thread has ended", "what was registered"]


def test_an_output_that_nobody_takes_is_no_success(more: dict[str, str]) -> None:
    process = _start("ends well", more, Path("/dev/full"))
    assert process.wait(20) in {1, 120}  # 120: at the very end, since Python had kept it until then


def test_it_has_the_descriptors_that_it_inherits_and_no_other(more: dict[str, str], tmp_path: Path) -> None:
    told, tell = os.pipe()
    with (tmp_path / "not inherited").open("wb"):
        process = _start("descriptors", more, tmp_path / "out", tell)
    os.close(tell)
    assert process.wait(20) == 0
    assert os.read(told, 100) == b"here"
    assert os.read(told, 100) == b"", "nobody else holds the other end"
    os.close(told)
    assert (tmp_path / "out").read_text() == f"[0, 1, 2, {tell}]\n"


def test_who_waits_too_briefly_is_told(more: dict[str, str], tmp_path: Path) -> None:
    process = _start("sleeps", more, tmp_path / "out")
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(0.05)
    assert process.poll() is None
    process.kill()
    assert process.wait(20) == -signal.SIGKILL


def test_a_module_that_cannot_be_imported_says_why_in_its_own_output(tmp_path: Path) -> None:
    with (tmp_path / "out").open("wb") as file:
        process = start_program("tests.no_such_program", (), (), {}, own_group=False, output=file.fileno())
    assert process.wait(20) == 1
    assert "No module named tests.no_such_program" in (tmp_path / "out").read_text()


@pytest.fixture
def own_launcher(monkeypatch: pytest.MonkeyPatch) -> Iterator[Launcher]:
    """A launcher of this test's own, which it may kill; also the one in its place ends with the test."""
    monkeypatch.setattr("rig.transport.launcher._the_launcher", None)
    yield launcher()
    end_launcher()


def test_without_its_launcher_a_program_is_started_all_the_same(own_launcher: Launcher, tmp_path: Path) -> None:
    os.kill(own_launcher.pid, signal.SIGKILL)
    wait_until(lambda: not own_launcher.runs, "the launcher is dead")
    process = _start("ends", {}, tmp_path / "out")
    assert isinstance(process, Launched), "another one has taken its place"
    assert process.wait(20) == 7


def test_a_launcher_that_dies_unseen_costs_nothing(own_launcher: Launcher, tmp_path: Path) -> None:
    os.kill(own_launcher.pid, signal.SIGSTOP)
    killer = threading.Timer(0.3, os.kill, (own_launcher.pid, signal.SIGKILL))  # while it is asked
    killer.start()
    process = _start("ends", {}, tmp_path / "out")
    killer.join()
    assert isinstance(process, subprocess.Popen)
    assert process.wait(20) == 7


def test_children_go_on_when_the_launcher_ends(own_launcher: Launcher, tmp_path: Path) -> None:
    process = _start("sleeps", {}, tmp_path / "out")
    assert isinstance(process, Launched)
    os.kill(own_launcher.pid, signal.SIGKILL)
    wait_until(lambda: not own_launcher.runs, "the launcher is dead")
    assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    assert process.wait(20) == -signal.SIGTERM
