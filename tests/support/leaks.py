"""What a test left behind: processes, threads, sockets, files, shared memory."""

import gc
import os
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tests.support.descriptors import Descriptor, open_descriptors
from tests.support.processes import Process, own_processes

_SHARED_MEMORY = Path("/dev/shm")  # noqa: S108 - looked at, not written
#: Threads of C libraries that end when what they serve is closed: a ZeroMQ context, an Aravis camera or stream.
_NATIVE_THREADS = ("ZMQbg", "arv_")
_POLL_S = 0.02


@dataclass(frozen=True, slots=True)
class Snapshot:
    """What there was at one moment."""

    processes: frozenset[Process]
    threads: frozenset[threading.Thread]
    native_threads: frozenset[tuple[int, str]]
    descriptors: frozenset[Descriptor]
    shared_memory: frozenset[Path]

    @classmethod
    def take(cls, token: str) -> "Snapshot":
        """Look around now."""
        # A dummy stands for a thread that some library started; Python never forgets it.
        threads = (t for t in threading.enumerate() if not isinstance(t, threading._DummyThread))
        return cls(
            own_processes(token), frozenset(threads), _native_threads(), open_descriptors(),
            _shared_memory(),
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Leaks:
    """What was not there before."""

    processes: tuple[Process, ...]
    others: tuple[str, ...]

    def __bool__(self) -> bool:
        """Whether anything was left."""
        return bool(self.processes or self.others)

    def __str__(self) -> str:
        """For people, one line each."""
        return "\n".join([*(str(process) for process in self.processes), *self.others])


def await_nothing_left(before: Snapshot, token: str, grace_s: float, spare_events: int, *, all_kinds: bool) -> Leaks:
    """Wait until nothing is left of what came after `before`.

    Args:
        before: taken when the test began.
        token: marks the processes of this run.
        grace_s: how long things may take to go.
        spare_events: so many new event descriptors are no leak.
        all_kinds: False looks at processes only.

    Returns:
        What is still there after `grace_s`.
    """
    deadline = time.monotonic() + grace_s
    left = _new_since(before, token, spare_events, all_kinds=all_kinds)
    if left:
        gc.collect()  # what only a reference cycle holds is not left behind
    while left and time.monotonic() < deadline:
        time.sleep(_POLL_S)
        left = _new_since(before, token, spare_events, all_kinds=all_kinds)
    return left


def _new_since(before: Snapshot, token: str, spare_events: int, *, all_kinds: bool) -> Leaks:
    now = Snapshot.take(token)
    known = {(process.pid, process.started) for process in before.processes}
    processes = tuple(p for p in now.processes if (p.pid, p.started) not in known)
    if not all_kinds:
        return Leaks(processes, ())
    others = [f"thread still runs: {thread.name}" for thread in now.threads - before.threads]
    others += [f"library thread still runs: {name}" for _, name in now.native_threads - before.native_threads]
    opened = now.descriptors - before.descriptors
    events = [descriptor for descriptor in opened if descriptor.is_event]
    others += [str(descriptor) for descriptor in opened if not descriptor.is_event]
    others += [str(descriptor) for descriptor in events if len(events) > spare_events]
    others += [
        f"shared memory still there: {path}"
        for path in now.shared_memory - before.shared_memory
        if not used_elsewhere(path)
    ]
    return Leaks(processes, tuple(sorted(others)))


def _shared_memory() -> frozenset[Path]:
    """Its pieces are files: a folder there is a disk for somebody, such as another program on this computer."""
    with os.scandir(_SHARED_MEMORY) as entries:
        return frozenset(Path(entry.path) for entry in entries if not entry.is_dir(follow_symlinks=False))


def _native_threads() -> frozenset[tuple[int, str]]:
    found = set()
    for task in Path("/proc/self/task").iterdir():
        with suppress(OSError):
            name = (task / "comm").read_text().strip()
            if name.startswith(_NATIVE_THREADS):
                found.add((int(task.name), name))
    return frozenset(found)


def used_elsewhere(path: Path) -> bool:
    """Whether a process that is not ours has this piece of shared memory open: then it is not ours either.

    A semaphore is mapped under the name that it had while it was made, so the file is known by its number.
    """
    try:
        file = path.stat()
    except FileNotFoundError:
        return True  # whoever has removed it just now used it
    mapped = f" {os.major(file.st_dev):02x}:{os.minor(file.st_dev):02x} {file.st_ino} "
    for folder in Path("/proc").glob("[0-9]*"):
        if int(folder.name) == os.getpid():
            continue
        with suppress(OSError):
            if mapped in (folder / "maps").read_text():
                return True
        for link in _links(folder / "fd"):
            with suppress(OSError):
                opened = link.stat()
                if (opened.st_dev, opened.st_ino) == (file.st_dev, file.st_ino):
                    return True
    return False


def _links(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except OSError:  # the process has ended, or is not ours to look at
        return []
