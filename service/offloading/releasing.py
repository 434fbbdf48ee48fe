"""Puts recordings into the trash that are safe on the other disk, if a rule of the rig file says so."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.background.child import run_child
from rig.background.messages import End, Failed
from rig.errors import SvevError
from rig.events import Event, Level
from rig.host.disk import free_bytes
from rig.phrase import Phrase, phrase, plain
from rig.settings.model import OffloadSettings, RigSettings
from service.offloading.copying import Confirm
from service.offloading.notes import CopyNotes, as_warning, mark_of
from service.offloading.verified_copy import sum_of

_RULES_LOOK_S: Final = 60.0
_DAY_S: Final = 86400.0
_GB: Final = 1e9


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
    """

    def __init__(
        self,
        folder: Path,
        in_use: Callable[[], RigSettings],
        notes: CopyNotes,
        removal: Removal,
        tell: Callable[[Event], None],
    ) -> None:
        self._folder, self._in_use, self._notes = folder, in_use, notes
        self._removal, self._tell = removal, tell
        self._next_look = time.monotonic()

    def next(self) -> Path | None:
        """The log that is to be released now: the oldest one that a rule lets go, and whose copy is there."""
        offload = self._in_use().offload
        if offload is None or not offload.releases or time.monotonic() < self._next_look:
            return None
        for log in self._let_go(offload):
            if self._is_safe(log, offload.to / log.name):
                return log
        self._next_look = time.monotonic() + _RULES_LOOK_S
        return None

    def release(self, log: Path, busy: Callable[[], bool], wanted: Callable[[], bool]) -> None:
        """Read a log and its copy once more and, if they are the same, put the log into the trash.

        Args:
            log: it.
            busy: whether to stand still.
            wanted: whether to go on at all.
        """
        offload = self._in_use().offload
        if offload is None:
            return
        order = Confirm(log=log, copy=offload.to / log.name)
        try:
            end = run_child("service.offloading.copying", order, End, busy=busy, wanted=wanted)
            if end is None:
                return
            if isinstance(end, Failed):
                self._kept(log, end.said)
                return
            if not self._notes.is_copied(log):  # changed meanwhile
                return
            self._removal.delete(log.stem)
        except SvevError as error:
            self._kept(log, error.said)
        except OSError as error:
            self._kept(log, plain(str(error)))
        else:
            text = "{recording} is released: it lies in {folder}, and here in the trash"
            said = phrase("event_released", text, recording=log.stem, folder=str(offload.to))
            self._tell(Event.now(Level.INFO, "service", said))

    def _let_go(self, offload: OffloadSettings) -> list[Path]:
        """The logs that the rules let go, the oldest first."""
        times = {}
        for log in self._folder.glob("*.mcap"):
            try:
                times[log] = log.stat().st_mtime
            except FileNotFoundError:
                continue
        logs = sorted(times, key=lambda log: (times[log], log.name))
        free = free_bytes(self._folder)
        wanted = 0.0 if offload.keep_free_GB is None else offload.keep_free_GB * _GB
        if free is not None and free + self._removal.in_trash() < wanted:
            return logs
        if offload.keep_days is None or not self._removal.clock_is_right():
            return []
        oldest = time.time() - offload.keep_days * _DAY_S
        return [log for log in logs if times[log] < oldest]

    def _is_safe(self, log: Path, copy: Path) -> bool:
        try:
            here, there = log.stat(), copy.stat()
            # a disk that is not mounted leaves an empty folder on the first one
            other_disk = there.st_dev != here.st_dev
            same = there.st_size == here.st_size and sum_of(copy).exists()
        except OSError:
            return False
        return other_disk and same and self._notes.is_copied(log)

    def _kept(self, log: Path, why: Phrase) -> None:
        """Say why a recording stays, and let it be copied again."""
        self._next_look = time.monotonic() + _RULES_LOOK_S
        self._notes.note(log, mark_of(log), as_warning(why))
        said = phrase("event_not_released", "{recording} is not released: {why}", recording=log.stem, why=why)
        self._tell(Event.now(Level.WARNING, "service", said))
