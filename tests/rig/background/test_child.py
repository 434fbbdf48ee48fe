"""A program that computes beside the service stands still at once, wherever it is in its work, and ends with it."""

import subprocess
import sys
import threading
import time
from pathlib import Path

from rig.background.child import run_child
from tests.rig.background.computing_program import Begun, Compute, Computed
from tests.support.waiting import wait_until

_PROGRAM = "tests.rig.background.computing_program"
_PATIENCE_S = 60.0


class _Errand:
    """A program that computes and says nothing meanwhile."""

    def __init__(self) -> None:
        self.busy, self.wanted, self.held, self.pid = False, True, [], 0  # type: ignore[var-annotated]
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> "_Errand":
        self._thread.start()
        wait_until(lambda: self.pid != 0, "it computes", _PATIENCE_S)
        return self

    def __exit__(self, *_: object) -> None:
        self.wanted = False
        self._thread.join()

    def _tell(self, news: Begun) -> None:
        self.pid = news.pid

    def _run(self) -> None:
        end = run_child(
            _PROGRAM, Compute(long=True), Begun | Computed, busy=lambda: self.busy, wanted=lambda: self.wanted,
            tell=self._tell, hold=self.held.append, yielding=False,
        )  # fmt: skip
        assert end is None


def test_it_stands_still_in_the_middle_of_its_work_and_goes_on() -> None:
    with _Errand() as errand:
        for _ in range(2):
            errand.busy = True
            wait_until(lambda: _state(errand.pid) == "T", "it stands still", poll_s=0.002)
            used = _cpu_ticks(errand.pid)
            time.sleep(0.1)  # in which it would use ten ticks
            assert _cpu_ticks(errand.pid) == used
            errand.busy = False
            wait_until(lambda: _state(errand.pid) != "T", "it goes on", poll_s=0.002)
        errand.busy = True
        wait_until(lambda: _state(errand.pid) == "T", "it is ended while it stands still", poll_s=0.002)
    assert errand.held == [True, False, True, False, True]
    assert not _exists(errand.pid)


def test_what_is_asked_for_during_a_recording_is_done_after_it() -> None:
    held: list[bool] = []
    said: list[Begun] = []
    begun = time.monotonic()

    def busy() -> bool:
        return time.monotonic() < begun + 1.0  # in which it would have started and done it

    def tell(news: Begun) -> None:
        assert not busy()
        said.append(news)

    end = run_child(
        _PROGRAM, Compute(long=False), Begun | Computed, busy=busy, wanted=lambda: True, tell=tell, hold=held.append,
        yielding=False,
    )  # fmt: skip
    assert (end, held, len(said)) == (Computed(), [True, False], 1)


def test_one_that_stands_still_is_killed_with_the_service() -> None:
    command = [sys.executable, "-m", "tests.rig.background.starting_program"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        wait_until(lambda: _state(pid) == "T", "it stands still", _PATIENCE_S)
        parent.kill()
    wait_until(lambda: not _exists(pid), "it is killed", _PATIENCE_S)


def _exists(pid: int) -> bool:
    """Whether it has not ended, or nobody has waited for it."""
    return Path(f"/proc/{pid}").exists() and _state(pid) != "Z"


def _state(pid: int) -> str:
    """T: stopped; Z: ended, not waited for."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0]
    except FileNotFoundError:
        return "Z"


def _cpu_ticks(pid: int) -> int:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    return int(fields[11]) + int(fields[12])
