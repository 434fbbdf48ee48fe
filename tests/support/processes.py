"""Finds the processes that this test process started, by /proc: children, their children, and orphans.

An orphan (its parent was killed) is no longer a descendant. It is known by a token in its environment, which every
process inherits from the test process that started it.
"""

import os
import signal
from collections import defaultdict
from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

TOKEN_VARIABLE = "SVEV_TEST_TOKEN"  # noqa: S105 - marks processes, guards nothing

#: Lives as long as the interpreter once anything of multiprocessing was used, and ends with it.
_RESOURCE_TRACKER = "multiprocessing.resource_tracker"

_STAT_BYTES = 4096


@dataclass(frozen=True, slots=True)
class Process:
    """One process; `started` (clock ticks since boot) tells it from a later one with the same pid.

    `cpu_ticks` is what it and the children that it waited for have used until now.
    """

    pid: int
    parent: int
    started: int
    state: str
    command: str
    cpu_ticks: int = field(default=0, compare=False)

    def __str__(self) -> str:
        """For people."""
        if self.state == "Z":
            return f"process {self.pid} ended but nobody waited for it: {self.command}"
        return f"process {self.pid} still runs: {self.command}"


#: Processes that are not ours, by token: those that were there before us, and those of others, such as the workers
#: beside us with their services and browsers. They are not looked at again, since a look takes the kernel some 50 us.
#: A number is given to another process only when all others have had their turn.
_foreign: defaultdict[str, set[int]] = defaultdict(set)
#: Processes that serve many tests, and so do not belong to the one that used them first.
_shared: set[int] = set()


@contextmanager
def shared_from_now_on(token: str) -> Iterator[None]:
    """What is started within serves many tests: with its children it counts as nobody's until it ends.

    Args:
        token: marks the processes of this run.
    """
    before = own_processes(token)
    yield
    _shared.update(process.pid for process in own_processes(token) - before)


def share(pid: int) -> None:
    """Count a process with its children as nobody's until it ends: it serves many tests."""
    _shared.add(pid)


def own_processes(token: str) -> frozenset[Process]:
    """All processes below this one and all that carry `token` in their environment, but for those that tests share."""
    everyone = all_processes(token)
    by_pid = {process.pid: process for process in everyone}
    return frozenset(p for p in everyone if p.pid not in _shared and not _descends(p, _shared, by_pid))


def all_processes(token: str) -> frozenset[Process]:
    """All processes below this one and all that carry `token` in their environment."""
    here = os.getpid()
    us = _read(here)
    assert us is not None
    pids = {int(name) for name in os.listdir("/proc") if name.isdecimal()}  # noqa: PTH208 - numbers, looked at often
    foreign = _foreign[token]
    foreign.intersection_update(pids)
    everyone = {pid: process for pid in pids - foreign if pid != here and (process := _read(pid))}
    ours = set()
    for process in everyone.values():
        if process.started < us.started:
            foreign.add(process.pid)
        elif _descends(process, {here}, everyone):
            ours.add(process)
        elif environment := _environment(process.pid):
            (ours.add(process) if _has(environment, token) else foreign.add(process.pid))
    return frozenset(process for process in ours if _RESOURCE_TRACKER not in process.command)


def end(process: Process) -> None:
    """Kill a process that a test left, so that it does not disturb the next one."""
    now = _read(process.pid)
    if now is None or now.started != process.started:
        return
    with suppress(ProcessLookupError):
        os.kill(process.pid, signal.SIGKILL)
    with suppress(ChildProcessError):  # an orphan or a grandchild is not ours to wait for
        os.waitpid(process.pid, 0)


def peak_memory_bytes() -> int:
    """The most memory that this program has used so far; getrusage also counts that of the process that started it."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) * 1024


def _read(pid: int) -> Process | None:
    """The process of this number; None if it has just gone."""
    try:
        stat = _stat(pid)
        # The name stands in parentheses and may hold anything, a closing parenthesis included.
        name, fields = stat[stat.index("(") + 1 : stat.rindex(")")], stat[stat.rindex(")") + 2 :].split()
        command = Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
    except OSError:
        return None
    cpu_ticks = sum(int(ticks) for ticks in fields[11:15])
    return Process(pid, int(fields[1]), int(fields[19]), fields[0], command or f"[{name}]", cpu_ticks)


def _stat(pid: int) -> str:
    """The line of /proc/PID/stat, without a file object: every process is looked at twice in each test."""
    descriptor = os.open(f"/proc/{pid}/stat", os.O_RDONLY | os.O_CLOEXEC)
    try:
        return os.read(descriptor, _STAT_BYTES).decode(errors="replace")
    finally:
        os.close(descriptor)


def _descends(process: Process, ancestors: Set[int], everyone: Mapping[int, Process]) -> bool:
    seen = set()
    current: Process | None = process
    while current is not None and current.pid not in seen:
        if current.parent in ancestors:
            return True
        seen.add(current.pid)
        current = everyone.get(current.parent)
    return False


def _environment(pid: int) -> bytes:
    """The environment that a process began with; empty while it begins or ends, or if it is not ours to look at."""
    try:
        return Path(f"/proc/{pid}/environ").read_bytes()
    except OSError:
        return b""


def _has(environment: bytes, token: str) -> bool:
    return f"{TOKEN_VARIABLE}={token}".encode() in environment.split(b"\0")
