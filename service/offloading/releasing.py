"""Puts recordings into the trash that are safe on the other disk, if a rule of the rig file says so."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from recorder.reading.parts import parts_of
from rig.background.child import run_child
from rig.background.messages import End, Failed
from rig.errors import SvevError
from rig.events import Event, Level
from rig.host.disk import free_bytes
from rig.phrase import Phrase, phrase, plain
from rig.settings.model import OffloadSettings, RigSettings
from service.offloading.notes import CopyNotes, as_warning, mark_of
from service.offloading.orders import PROGRAM, confirming
from service.offloading.verified_copy import sum_of

_RULES_LOOK_S: Final = 60.0
_DAY_S: Final = 86400.0
_GB: Final = 1e9
#: A log whose inode changed so long after it was written has come back, from the trash or from its copy.
_CAME_BACK_S: Final = 60.0
#: Whoever fetches a recording wants to do something with it: so long no rule takes it.
_WANTED_S: Final = _DAY_S


@dataclass(frozen=True, slots=True)
class Removal:
    """How recordings are removed.

    Attributes:
        delete: puts a recording into the trash.
        in_trash: how much room the trash holds, bytes; it is made free when it is needed.
        clock_is_right: whether the clock may say what is old.
    """

    delete: Callable[[str], object]
    in_trash: Callable[[], int]
    clock_is_right: Callable[[], bool]


class Releasing:
    """Used by one thread.

    Args:
        folder: of the recordings.
        in_use: gives the rig in use.
        notes: what is copied.
        removal: how recordings are removed.
        tell: takes an event for the live log.
        now: the time, UNIX time, s.
    """

    def __init__(
        self,
        folder: Path,
        in_use: Callable[[], RigSettings],
        notes: CopyNotes,
        removal: Removal,
        tell: Callable[[Event], None],
        now: Callable[[], float] = time.time,
    ) -> None:
        self._folder, self._in_use, self._notes = folder, in_use, notes
        self._removal, self._tell, self._now = removal, tell, now
        self._next_look = time.monotonic()

    def next(self) -> tuple[Path, ...] | None:
        """The logs of the recording that is to be released now: the oldest one that a rule lets go, and that is safe.

        A split recording is released whole, when all its parts are safe and old enough.
        """
        offload = self._in_use().offload
        if offload is None or not offload.releases or time.monotonic() < self._next_look:
            return None
        for logs in self._let_go(offload):
            if all(self._is_safe(log, offload) for log in logs):
                return logs
        self._next_look = time.monotonic() + _RULES_LOOK_S
        return None

    def release(self, logs: Sequence[Path], busy: Callable[[], bool], wanted: Callable[[], bool]) -> None:
        """Read the logs of a recording and their copies once more and, if they are the same, put it into the trash.

        Args:
            logs: they, in order.
            busy: whether to stand still.
            wanted: whether to go on at all.
        """
        offload = self._in_use().offload
        if offload is None:
            return
        log = logs[0]
        try:
            for log in logs:
                end = run_child(PROGRAM, confirming(log, offload), End, busy=busy, wanted=wanted)
                if end is None:
                    return
                if isinstance(end, Failed):
                    self._kept(log, end.said)
                    return
            if not all(self._notes.is_copied(log) for log in logs):  # changed meanwhile
                return
            for log in reversed(logs):  # what is left after a failure is the beginning
                self._removal.delete(log.stem)
        except SvevError as error:
            self._kept(log, error.said)
        except OSError as error:
            self._kept(log, plain(str(error)))
        else:
            text = "{recording} is released: it lies in {folder}, and here in the trash"
            said = phrase("event_released", text, recording=logs[0].stem, folder=offload.place)
            self._tell(Event.now(Level.INFO, "service", said))

    def _let_go(self, offload: OffloadSettings) -> list[tuple[Path, ...]]:
        """The logs of each recording that the rules let go, the oldest first.

        A recording is as old as what was written last of it, or as its return from the trash or from its copy.
        """
        times: dict[tuple[Path, ...], float] = {}
        now = self._now()
        for log in self._folder.glob("*.mcap"):
            logs = parts_of(log)
            try:
                stats = [each.stat() for each in logs]
            except FileNotFoundError:
                continue
            written, placed = max(each.st_mtime for each in stats), max(each.st_ctime for each in stats)
            if placed - written < _CAME_BACK_S or not 0 <= now - placed < _WANTED_S:
                times[logs] = max(written, placed)
        found = sorted(times, key=lambda logs: (times[logs], logs[0].name))
        free = free_bytes(self._folder)
        wanted = 0.0 if offload.keep_free_GB is None else offload.keep_free_GB * _GB
        if free is not None and free + self._removal.in_trash() < wanted:
            return found
        if offload.keep_days is None or not self._removal.clock_is_right():
            return []
        oldest = now - offload.keep_days * _DAY_S
        return [logs for logs in found if times[logs] < oldest]

    def _is_safe(self, log: Path, offload: OffloadSettings) -> bool:
        if not self._notes.is_copied(log):
            return False
        if offload.to is None:
            return True  # the store is asked when log and copy are read once more
        copy = offload.to / log.name
        try:
            here, there = log.stat(), copy.stat()
            # a disk that is not mounted leaves an empty folder on the first one
            other_disk = there.st_dev != here.st_dev
            return other_disk and there.st_size == here.st_size and sum_of(copy).exists()
        except OSError:
            return False

    def _kept(self, log: Path, why: Phrase) -> None:
        """Say why a recording stays, and let it be copied again."""
        self._next_look = time.monotonic() + _RULES_LOOK_S
        self._notes.note(log, mark_of(log), as_warning(why))
        said = phrase("event_not_released", "{recording} is not released: {why}", recording=log.stem, why=why)
        self._tell(Event.now(Level.WARNING, "service", said))
