"""Writes chunks to the disk in a thread of its own, in order, makes them durable twice a second, and closes the file.

All calls that may wait for the disk are made here, so nobody else ever waits for a hanging disk.
"""

import mmap
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from recorder.log.index import LogIndex
from recorder.log.mcap_layout import ChunkPlan, join_pages
from recorder.writing.append_file import AppendFile, storage_error
from rig.errors import StorageError
from rig.health import WritingHealth
from rig.phrase import phrase

#: What was written is made durable after so long: the disk has as much again until it is a second old.
_SYNC_INTERVAL_S: Final = 0.5
_LOOK_INTERVAL_S: Final = 1.0
_SMALL_AT_ONCE = 64
#: So many small chunks wait only if the disk has taken nothing for minutes.
_SMALL_WAITING_MAX = 20_000


@dataclass(frozen=True, slots=True)
class _Job:
    """A chunk that waits for the disk.

    Attributes:
        data: the pages of a slot or, if `slot` is None, a small chunk that is not padded yet.
        plan: where the chunk stands in `data`.
        slot: the slot.
        is_pulse: whether the chunk is that of a pulse.
    """

    data: memoryview | bytes
    plan: ChunkPlan
    slot: int | None
    is_pulse: bool


class _Queue:
    """The chunks that wait for the disk, in order; any thread may add to them.

    Attributes:
        busy_since: when the disk last finished something, or got something to do; None: it has nothing to do.
        stopping: whether no more will come.
    """

    def __init__(self) -> None:
        self.busy_since: float | None = None
        self.stopping = False
        self._jobs: deque[_Job] = deque()
        self._small = 0
        self._closed = False
        self._wake = threading.Condition()

    def __len__(self) -> int:
        return len(self._jobs)

    def put(self, job: _Job, path: Path) -> bool:
        """Add a chunk; False: it is not taken, since writing has ended.

        Raises:
            StorageError: there are too many small chunks.
        """
        with self._wake:
            if self._closed:
                return False
            if job.slot is None:
                if self._small >= _SMALL_WAITING_MAX:
                    text = "{path}: the disk has taken nothing for long; look at `dmesg`, record to another disk"
                    raise StorageError(phrase("why_disk_takes_nothing_long", text, path=str(path)))
                self._small += 1
            self._jobs.append(job)
            if self.busy_since is None:
                self.busy_since = time.monotonic()
            self._wake.notify()
        return True

    def stop(self) -> None:
        """Say that no more will come."""
        with self._wake:
            self.stopping = True
            self._wake.notify()

    def take(self) -> list[_Job] | None:
        """The next slot, or small chunks up to the next slot; empty: there will be none; None: none came in time."""
        with self._wake:
            if not self._jobs:
                self.busy_since = None
                if not self.stopping:
                    self._wake.wait(_SYNC_INTERVAL_S)
            if not self._jobs:
                if not self.stopping:
                    return None
                self.busy_since = time.monotonic()
                return []
            taken = [self._jobs.popleft()]
            if taken[0].slot is None:
                while self._jobs and self._jobs[0].slot is None and len(taken) < _SMALL_AT_ONCE:
                    taken.append(self._jobs.popleft())
                self._small -= len(taken)
            return taken

    def close(self) -> list[_Job]:
        """Take no more; returns what nobody will write any more."""
        with self._wake:
            self._closed = True
            left, self._jobs = list(self._jobs), deque()
        return left


class _DurableFile:
    """The file: what is written is made durable now and then, and timed.

    Attributes:
        free_bytes: room on the disk about a second ago.
        slowest_write_s: the longest that the disk took for one write.
        slowest_sync_s: the longest that it took to make something durable.
    """

    def __init__(self, file: AppendFile) -> None:
        self.free_bytes = file.look()
        self.slowest_write_s = self.slowest_sync_s = 0.0
        self._file = file
        self._unsynced_since: float | None = None
        self._looked = 0.0

    def append(self, pages: memoryview | mmap.mmap) -> None:
        """Write pages."""
        begin = time.monotonic()
        self._file.append(pages)
        now = time.monotonic()
        self.slowest_write_s = max(self.slowest_write_s, now - begin)
        if self._unsynced_since is None:
            self._unsynced_since = now

    def keep_up(self) -> None:
        """Now and then: make durable what was written, see whether the file is still in its place."""
        now = time.monotonic()
        if self._unsynced_since is not None and now - self._unsynced_since >= _SYNC_INTERVAL_S:
            self.sync()
        if now - self._looked >= _LOOK_INTERVAL_S:
            self.free_bytes = self._file.look()
            self._looked = now

    def sync(self) -> None:
        """Make durable what was written."""
        begin = time.monotonic()
        self._file.sync()
        self.slowest_sync_s = max(self.slowest_sync_s, time.monotonic() - begin)
        self._unsynced_since = None


class WriteThread:
    """Takes chunks from any thread and appends them to the file; closes the file at the end.

    After the first error it writes no more chunks; it releases the slots that wait, counts the chunks, and still tries
    to close the file. Whatever happens in it, an error of the program included, ends up in `error`.

    Attributes:
        error: why writing ended, None while it goes on.
        unwritten: chunks that were queued and did not reach the file.
        pulses: pulses that are in the file.
        over: set when the thread is done with the file, closed or not.
        closed: whether the end of the log was written.
    """

    def __init__(
        self, file: AppendFile, index: LogIndex, release: Callable[[int], None], closing_bytes: Callable[[], bytes]
    ):
        """Start the thread.

        Args:
            file: the file; nobody else writes to it from now on.
            index: gets every chunk that is whole in the file.
            release: called with each slot that is in the file, or never will be.
            closing_bytes: makes the end of the log, when all chunks are written.
        """
        self.error: StorageError | None = None
        self.unwritten = self.pulses = 0
        self.over = threading.Event()
        self.closed = self._given_up = False
        self._file, self._disk, self._queue = file, _DurableFile(file), _Queue()
        self._index, self._release, self._closing_bytes = index, release, closing_bytes
        threading.Thread(target=self._run, name=f"log {file.path.name}", daemon=True).start()

    @property
    def stopping(self) -> bool:
        """Whether the thread was told to end."""
        return self._queue.stopping

    @property
    def free_bytes(self) -> int:
        """Room on the disk about a second ago."""
        return self._disk.free_bytes

    def submit(
        self, chunk: memoryview | bytes, plan: ChunkPlan, slot: int | None = None, *, is_pulse: bool = False
    ) -> None:
        """Queue the pages of a completed slot (the number of slots limits how many wait), or a small chunk.

        Raises:
            StorageError: writing has ended, or the disk has taken nothing for so long that the queue of small chunks is
                full. The slot stays the caller's.
        """
        if not self._queue.put(_Job(chunk, plan, slot, is_pulse), self._file.path):
            raise self.error or StorageError(f"{self._file.path}: the log is closed; open another one")

    def stop(self) -> None:
        """Write what waits, close the file, and end the thread; `over` tells when that is done."""
        self._queue.stop()

    def give_up(self, error: StorageError) -> None:
        """End writing with an error found by somebody else, e.g. that the disk hangs; return at once."""
        self.error, self._given_up = self.error or error, True
        self.stop()

    def stalled_s(self) -> float:
        """For how long the disk has not finished anything although something waits for it, s."""
        since = self._queue.busy_since
        return 0.0 if since is None else time.monotonic() - since

    def statistics(self) -> WritingHealth:
        """How writing goes since the log was opened; `queued` chunks wait for the disk."""
        return WritingHealth(
            bytes_written=self._file.size,
            queued=len(self._queue),
            slowest_write_ms=round(self._disk.slowest_write_s * 1e3, 3),
            slowest_sync_ms=round(self._disk.slowest_sync_s * 1e3, 3),
            direct=self._file.direct,
        )

    def _run(self) -> None:
        try:
            while jobs := self._next():
                written = False
                try:
                    written = self._attempt(self._write, jobs)
                finally:
                    self._done(jobs, written=written)
            self._attempt(self._disk.sync)
            self._finish()
        except BaseException as error:  # noqa: BLE001 - whatever it is, it must not end the thread in silence
            traceback.print_exception(error)
            self._broken(error)
        finally:
            self._done(self._queue.close(), written=False)
            self._file.close()
            self._queue.busy_since = None
            self.over.set()

    def _next(self) -> list[_Job]:
        """The next chunks, with what was written made durable while none waits; empty at the end."""
        while (jobs := self._queue.take()) is None:
            self._attempt(self._disk.keep_up)
        return jobs

    def _attempt(self, step: Callable[..., None], *arguments: Any) -> bool:
        """Take a step that uses the disk, unless writing has ended; the first error ends it.

        Returns:
            Whether the step was taken to its end.
        """
        if self.error is None:
            try:
                step(*arguments)
            except OSError as error:
                self._fail(storage_error(self._file.path, error), error)
            except StorageError as error:
                self._fail(error, error.__cause__)
        return self.error is None

    def _done(self, jobs: list[_Job], *, written: bool) -> None:
        if written:
            self.pulses += sum(job.is_pulse for job in jobs)
        else:
            self.unwritten += len(jobs)
        for job in jobs:
            if job.slot is not None:
                self._release(job.slot)
        if self._queue.busy_since is not None:
            self._queue.busy_since = time.monotonic()

    def _write(self, jobs: list[_Job]) -> None:
        position = self._file.size
        if jobs[0].slot is not None:
            self._disk.append(memoryview(jobs[0].data))
        else:
            self._disk.append(join_pages(bytes(job.data) for job in jobs))
        for job in jobs:
            self._index.add_chunk(position, job.plan)
            position += len(job.data)
        self._disk.keep_up()

    def _finish(self) -> None:
        """Write the end of the log and make it durable; after an error too, if the disk takes it."""
        if self._given_up:
            return  # what is in the file is not known: the call that hung may have written after all
        try:
            self._file.finish(self._closing_bytes())
            self.closed = True
        except OSError as error:
            self._fail(storage_error(self._file.path, error), error)

    def _fail(self, reason: StorageError, cause: BaseException | None) -> None:
        if self.error is None:
            self.error = reason
            self.error.__cause__ = cause
        try:
            self._file.cut()
        except OSError as second:
            self.error.add_note(f"the torn end could not be cut off: {second}")

    def _broken(self, error: BaseException) -> None:
        """Note an error of the program, which nobody foresaw."""
        text = "{path}: writing ended by {kind}: {error}; what is written so far stays readable; report this"
        kind, path = type(error).__name__, str(self._file.path)
        said = phrase("why_writing_broke", text, path=path, kind=kind, error=str(error))
        self.error = self.error or StorageError(said)
