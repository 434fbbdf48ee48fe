"""Writes chunks to the disk in a thread of its own, in order, and makes them durable once a second."""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from recorder.log.index import LogIndex
from recorder.log.mcap_layout import ChunkPlan, join_pages
from recorder.writing.append_file import AppendFile, storage_error
from rig.errors import StorageError
from rig.health import WritingHealth

SYNC_INTERVAL_S = 1.0
_SMALL_AT_ONCE = 64
#: So many small chunks wait only if the disk has taken nothing for minutes.
_SMALL_WAITING_MAX = 20_000


@dataclass(frozen=True, slots=True)
class _Job:
    """A chunk that waits for the disk: the pages of a slot, or, if `slot` is None, small and not padded yet."""

    data: memoryview | bytes
    plan: ChunkPlan
    slot: int | None


class WriteThread:
    """Takes chunks from any thread and appends them to the file.

    After the first error it writes nothing more; it releases the slots that wait, and counts the chunks.

    Attributes:
        error: why writing ended, None while it goes on.
        unwritten: chunks that were queued and did not reach the file.
    """

    def __init__(self, file: AppendFile, index: LogIndex, release: Callable[[int], None]):
        """Start the thread.

        Args:
            file: the file; nobody else writes to it until `stop`.
            index: gets every chunk that is whole in the file.
            release: called with each slot that is in the file, or never will be.
        """
        self.error: StorageError | None = None
        self.unwritten = 0
        self._file = file
        self._index = index
        self._release = release
        self._jobs: deque[_Job] = deque()
        self._small_waiting = 0
        self._stopping = False
        self._wake = threading.Condition()
        self._unsynced_since: float | None = None
        self._slowest_write = 0.0
        self._slowest_sync = 0.0
        self._thread = threading.Thread(target=self._run, name=f"log {file.path.name}", daemon=True)
        self._thread.start()

    def submit(self, chunk: memoryview | bytes, plan: ChunkPlan, slot: int | None = None) -> None:
        """Queue the pages of a completed slot (the number of slots limits how many wait), or a small chunk.

        Raises:
            StorageError: the disk has taken nothing for so long that the queue of small chunks is full.
        """
        with self._wake:
            if slot is None:
                if self._small_waiting >= _SMALL_WAITING_MAX:
                    raise StorageError(
                        f"{self._file.path}: the disk has taken nothing for long; look at `dmesg`, "
                        "record to another disk"
                    )
                self._small_waiting += 1
            self._jobs.append(_Job(chunk, plan, slot))
            self._wake.notify()

    def stop(self, timeout_s: float) -> None:
        """Write what waits, sync, and end the thread; a second call does nothing.

        Raises:
            StorageError: the disk did not take the rest within `timeout_s`.
        """
        with self._wake:
            self._stopping = True
            self._wake.notify()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            raise StorageError(
                f"{self._file.path}: the disk has not taken the rest within {timeout_s:g} s; look at `dmesg`, "
                "and check the log with `svev verify`"
            )

    def statistics(self) -> WritingHealth:
        """How writing goes since the log was opened; `queued` chunks wait for the disk."""
        return WritingHealth(
            bytes_written=self._file.size,
            queued=len(self._jobs),
            slowest_write_ms=round(self._slowest_write * 1e3, 3),
            slowest_sync_ms=round(self._slowest_sync * 1e3, 3),
            direct=self._file.direct,
        )

    def _run(self) -> None:
        while jobs := self._next():
            if not self._attempt(self._write, jobs):
                self.unwritten += len(jobs)
            for job in jobs:
                if job.slot is not None:
                    self._release(job.slot)
        self._attempt(self._sync)

    def _next(self) -> list[_Job]:
        """The next slot, or all small chunks up to the next slot; syncs while none waits; empty at the end."""
        while True:
            with self._wake:
                if not self._jobs and not self._stopping:
                    self._wake.wait(SYNC_INTERVAL_S)
                if self._jobs:
                    return self._take()
                if self._stopping:
                    return []
            self._attempt(self._sync_if_due)

    def _attempt(self, step: Callable[..., None], *arguments: Any) -> bool:
        """Take a step that uses the disk, unless writing has ended; the first error ends it.

        Returns:
            Whether the step was taken to its end.
        """
        if self.error is None:
            try:
                step(*arguments)
            except OSError as error:
                self._fail(error)
        return self.error is None

    def _take(self) -> list[_Job]:
        taken = [self._jobs.popleft()]
        if taken[0].slot is None:
            while self._jobs and self._jobs[0].slot is None and len(taken) < _SMALL_AT_ONCE:
                taken.append(self._jobs.popleft())
            self._small_waiting -= len(taken)
        return taken

    def _write(self, jobs: list[_Job]) -> None:
        begin = time.monotonic()
        position = self._file.size
        if jobs[0].slot is not None:
            self._file.append(memoryview(jobs[0].data))
        else:
            with join_pages(bytes(job.data) for job in jobs) as pages:
                self._file.append(pages)
        for job in jobs:
            self._index.add_chunk(position, job.plan)
            position += len(job.data)
        now = time.monotonic()
        self._slowest_write = max(self._slowest_write, now - begin)
        if self._unsynced_since is None:
            self._unsynced_since = now
        self._sync_if_due()

    def _sync_if_due(self) -> None:
        if self._unsynced_since is not None and time.monotonic() - self._unsynced_since >= SYNC_INTERVAL_S:
            self._sync()

    def _sync(self) -> None:
        begin = time.monotonic()
        self._file.sync()
        self._slowest_sync = max(self._slowest_sync, time.monotonic() - begin)
        self._unsynced_since = None

    def _fail(self, error: OSError) -> None:
        self.error = storage_error(self._file.path, error)
        self.error.__cause__ = error
        try:
            self._file.cut()
        except OSError as second:
            self.error.add_note(f"the torn end could not be cut off: {second}")
