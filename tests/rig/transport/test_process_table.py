"""Child processes: control channel, lifeline, deadline; nothing is left behind, however a process ends."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest

from rig.errors import ProcessDiedError
from rig.transport.message import Quit
from rig.transport.process_table import Child, ProcessSpec, ProcessTable
from tests.rig.transport.echo_process import EchoConfig
from tests.support.waiting import wait_until

ECHO = "tests.rig.transport.echo_process"


def _spec(name: str, *, value: int = 0, deaf: bool = False) -> ProcessSpec:
    return ProcessSpec(name, ECHO, EchoConfig(value=value, deaf=deaf), reports=EchoConfig)


def test_a_child_gets_its_configuration_and_stops_when_asked() -> None:
    table = ProcessTable()
    table.start(_spec("echo", value=42))
    assert _receive(table, 1) == [("echo", EchoConfig(value=42))]
    assert table.stop() == []


def test_a_killed_child_is_noticed_and_can_be_started_again() -> None:
    table = ProcessTable()
    child = table.start(_spec("echo", value=1))
    os.kill(child.pid, signal.SIGKILL)
    wait_until(lambda: table.dead() == [child], "the death is noticed")
    assert child.ending() == "killed by SIGKILL"
    again = table.start(child.spec)
    assert again.pid != child.pid
    wait_until(lambda: bool(table.receive(0.1)), "the new child has answered")
    table.stop()


def test_a_child_that_does_not_stop_is_killed_at_the_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.transport.process_table._STOP_S", 0.5)
    table = ProcessTable()
    table.start(_spec("deaf", deaf=True))
    wait_until(lambda: bool(table.receive(0.1)), "the child has answered")
    assert table.stop() == ["deaf"]


PARENT = f"""
import os, signal, sys
from rig.transport.process_table import ProcessSpec, ProcessTable
from tests.rig.transport.echo_process import EchoConfig
table = ProcessTable()
environment = dict(variable.split("=") for variable in sys.argv[1:])
spec = ProcessSpec("echo", {ECHO!r}, EchoConfig(value=1), reports=EchoConfig, environment=environment)
child = table.start(spec)
while not table.receive(1):
    pass
if environment:
    os.kill(child.pid, signal.SIGSTOP)
print(child.pid, flush=True)
signal.pause()
"""


@pytest.mark.parametrize("environment", [[], ["ECHO_KILLED_WITH_PARENT=1"]], ids=["running", "frozen"])
def test_children_end_when_the_parent_is_killed(environment: list[str]) -> None:
    parent = subprocess.Popen([sys.executable, "-c", PARENT, *environment], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    pid = int(parent.stdout.readline())
    parent.kill()
    parent.wait(10)
    parent.stdout.close()
    wait_until(lambda: not _alive(pid), "the child is gone")


def test_an_answer_is_awaited_until_the_deadline_and_then_the_child_is_killed() -> None:
    child = Child(_spec("echo", value=7))
    assert child.answer(10.0) == EchoConfig(value=7)
    with pytest.raises(ProcessDiedError, match=r"^echo did not answer for 0 s, so it was ended: restart it$"):
        child.answer(0.2)
    assert child.ending() == "killed by SIGKILL"


def test_a_child_that_ended_does_not_answer() -> None:
    child = Child(_spec("echo"))
    child.control.send(Quit())
    assert child.answer(10.0) == EchoConfig()
    with pytest.raises(ProcessDiedError, match=r"^echo ended by itself \(exit code 0\): see its messages above$"):
        child.answer(10.0)
    assert not child.stop(1.0)


def test_a_child_in_a_process_group_of_its_own() -> None:
    ours, apart = Child(_spec("ours")), Child(replace(_spec("apart"), own_group=True))
    assert os.getpgid(ours.pid) == os.getpgrp()
    assert os.getpgid(apart.pid) == apart.pid
    for child in (ours, apart):
        child.control.send(Quit())
        assert not child.stop(8.0)


def _receive(table: ProcessTable, count: int) -> list[tuple[str, EchoConfig]]:
    received: list[tuple[str, EchoConfig]] = []

    def enough() -> bool:
        received.extend(table.receive(0.1))
        return len(received) >= count

    wait_until(enough, f"{count} messages have come")
    return received


def _alive(pid: int) -> bool:
    """Whether the process runs; a zombie does not."""
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as stat:  # noqa: PTH123
            return stat.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_stopping_takes_no_longer_than_the_slowest_child() -> None:
    table = ProcessTable()
    for name in ("a", "b", "c"):
        table.start(_spec(name, value=1))
    _receive(table, 3)
    before = time.monotonic()
    assert table.stop() == []
    assert time.monotonic() - before < 8.0  # the deadline is one for all, not one each


def test_an_error_in_a_thread_ends_the_process() -> None:
    program = (
        "import threading, time\n"
        "from rig.transport.child import end_with_failed_thread\n"
        "end_with_failed_thread()\n"
        "threading.Thread(target=lambda: 1 // 0).start()\n"
        "threading.Event().wait(60)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=50, check=False)
    assert done.returncode == 70
    assert "ZeroDivisionError" in done.stderr
