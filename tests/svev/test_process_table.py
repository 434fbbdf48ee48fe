"""Child processes: control channel, lifeline, deadline, and nothing left behind however it ends."""

import os
import signal
import subprocess
import sys
import time

import pytest

from rig.control import Message
from svev.process_table import ProcessSpec, ProcessTable
from tests.support.waiting import wait_until

ECHO = "tests.svev.echo_process"


def test_a_child_gets_its_configuration_and_stops_when_asked() -> None:
    table = ProcessTable()
    table.start(ProcessSpec("echo", ECHO, {"value": 42}))
    assert _receive(table, 1) == [("echo", {"report": "config", "value": 42})]
    assert table.stop() == []


def test_a_killed_child_is_noticed_and_can_be_started_again() -> None:
    table = ProcessTable()
    child = table.start(ProcessSpec("echo", ECHO, {"value": 1}))
    os.kill(child.pid, signal.SIGKILL)
    wait_until(lambda: table.dead() == [child], "the death is noticed")
    assert child.ending() == "killed by SIGKILL"
    again = table.start(child.spec)
    assert again.pid != child.pid
    wait_until(lambda: bool(table.receive(0.1)), "the new child has answered")
    table.stop()


def test_a_child_that_does_not_stop_is_killed_at_the_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("svev.process_table._STOP_S", 0.5)
    table = ProcessTable()
    table.start(ProcessSpec("deaf", ECHO, {"deaf": True}))
    wait_until(lambda: bool(table.receive(0.1)), "the child has answered")
    assert table.stop() == ["deaf"]


def test_children_end_when_the_parent_is_killed() -> None:
    program = f"""
from rig.control import Message
from svev.process_table import ProcessSpec, ProcessTable
table = ProcessTable()
child = table.start(ProcessSpec("echo", {ECHO!r}, {{"value": 1}}))
while not table.receive(1):
    pass
print(child.pid, flush=True)
import signal
signal.pause()
"""
    parent = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    pid = int(parent.stdout.readline())
    parent.kill()
    parent.wait(10)
    parent.stdout.close()
    wait_until(lambda: not _alive(pid), "the child is gone")


def _receive(table: ProcessTable, count: int) -> list[tuple[str, Message]]:
    received: list[tuple[str, Message]] = []

    def enough() -> bool:
        received.extend(table.receive(0.1))
        return len(received) >= count

    wait_until(enough, f"{count} messages have come", 10)
    return received


def _alive(pid: int) -> bool:
    """Running, not merely waiting to be collected by whoever adopted it."""
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii") as stat:  # noqa: PTH123
            return stat.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_stopping_takes_no_longer_than_the_slowest_child() -> None:
    table = ProcessTable()
    for name in ("a", "b", "c"):
        table.start(ProcessSpec(name, ECHO, {"value": 1}))
    _receive(table, 3)
    before = time.monotonic()
    assert table.stop() == []
    assert time.monotonic() - before < 8.0  # the deadline is one for all, not one each
