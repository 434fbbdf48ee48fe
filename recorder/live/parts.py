"""The logs of one recording: it goes on in another one when one fails, or is as large as a part may be."""

import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from recorder.live.assembler import Assembler
from recorder.live.recording import Recording
from recorder.log.beside import named, numbered
from rig.api.recordings import Counts
from rig.clocks import HostNs, UtcNs, host_now
from rig.errors import FileVanishedError, NameTakenError, StorageError, SvevError
from rig.pulse import Pause
from rig.transport.recorder_reports import LogPart, RecorderFailed, RecordingFinished, RecordingProgress

#: So many logs of a recording may fail; then it ends.
_FAILURES_MAX: Final = 19
#: The log of the next part is made so long before its first pulse, s.
_AHEAD_S: Final = 1.0
#: A part ends with a pulse that comes early by less than this share of a period.
_EARLY: Final = 0.5
_GB: Final = 1e9


@dataclass(frozen=True, slots=True)
class _Account:
    """The report on a log; of a closed one nothing else is kept."""

    part: LogPart
    first_time: UtcNs | None
    pauses: tuple[Pause, ...]
    is_there: bool
    gone: FileVanishedError | None
    trouble: str

    @classmethod
    def of(cls, log: Recording) -> "_Account":
        gone = log.ending.failure if isinstance(log.ending.failure, FileVanishedError) else None
        trouble = "" if log.ending.trouble is None else str(log.ending.trouble)
        return cls(log.part(), log.account.ledger.first_time, log.account.ledger.pauses(), log.is_there, gone, trouble)


class Parts:
    """The logs of a recording before the present one, and the one after it.

    Args:
        assembler: makes the triplets, by the settings of its rig.

    Attributes:
        earlier: logs before the present one of which something may still be written, in order.
    """

    def __init__(self, assembler: Assembler) -> None:
        self._assembler = assembler
        self._fallback = assembler.rig.recorder.fallback_directory
        self.earlier: list[Recording] = []
        self._closed: list[_Account] = []
        self._number = self._failures = 0
        self._following: Recording | None = None
        self._refused_s = 0.0
        self._refused_bytes = 0
        self._removing: threading.Thread | None = None

    @property
    def is_first(self) -> bool:
        """Whether the present log is the first one."""
        return not (self.earlier or self._closed)

    def begin(self) -> None:
        """Forget the logs of the last recording."""
        self.earlier.clear()
        self._closed.clear()
        self._number = self._failures = 0
        self._refused_s = self._refused_bytes = 0

    def settle(self, now: HostNs) -> None:
        """Account for the pulses in the files; of a closed log keep only its account."""
        for each in self.earlier:
            each.confirm(now)
        while self.earlier and self.earlier[0].settled and (self.earlier[0].ending.next_part or len(self.earlier) > 1):
            self._closed.append(_Account.of(self.earlier.pop(0)))

    def progress(self, present: Recording) -> RecordingProgress:
        """What became of the pulses in all logs that are there; their numbers go on from log to log."""
        accounts = [each for each in self._accounts(present) if each.is_there]
        return RecordingProgress(
            counts=Counts.sum(each.part.counts for each in accounts),
            first_pulse=next((each.first_time for each in accounts if each.first_time is not None), None),
            pauses=tuple(pause for each in accounts for pause in each.pauses),
        )

    def following(self, present: Recording, time: HostNs) -> Recording | None:
        """The next part, from the first pulse on that the present log has no room for; None: it has.

        Args:
            present: the present log.
            time: of the next pulse.

        Raises:
            BadInputError: the name of the recording is too long for the log.
        """
        if not self._is_full(present, time, _AHEAD_S):
            return None
        if self._following is None:
            path = self._path(present, present.path.parent)
            order = present.continuation(path, part=True)
            self._following = Recording(order, self._assembler, present, self._number)
        return self._following if self._is_full(present, time, 0.0) else None

    def turn_over(self, present: Recording, following: Recording) -> None:
        """Begin the next part, and close the present log, all pulses of which are in the file."""
        following.follow(present)
        present.ending.next_part = following.path.stem
        self.earlier.append(present)
        self._following, self._refused_s, self._refused_bytes = None, 0.0, 0
        present.begin_close()

    def refuse(self, present: Recording, time: HostNs, error: SvevError) -> None:
        """The next part cannot be made: the present log takes as much again."""
        self._following = None
        self._number -= not isinstance(error, NameTakenError)
        self._refused_s, self._refused_bytes = present.lasts_s(time), present.size

    def drop_following(self) -> None:
        """Remove the log of a next part that no pulse came for."""
        if self._following is not None:
            self._removing, self._following = self._following.opening.discard(), None

    def _is_full(self, present: Recording, time: HostNs, ahead_s: float) -> bool:
        """Whether a log is as large as a part may be at a time, or `ahead_s` later."""
        lasts_s, (part_s, part_gb) = present.lasts_s(time), present.part_limits
        if lasts_s == 0.0:
            return False
        rate_hz = self._assembler.rig.trigger.rate_hz
        if part_s is not None and lasts_s + ahead_s + _EARLY / rate_hz >= self._refused_s + part_s:
            return True
        coming = self._assembler.buffers.layout.slot_bytes * (1 + ahead_s * rate_hz)
        return part_gb is not None and present.size + coming > self._refused_bytes + part_gb * _GB

    def next_path(self, present: Recording, error: SvevError) -> Path | None:
        """Where to go on after a failure; None: nowhere.

        After a file has vanished its own folder is as good as before; it is made again if need be.
        """
        folder: Path | None = None
        if isinstance(error, FileVanishedError):
            folder = present.path.parent
        elif isinstance(error, StorageError):
            folder = self.other_folder(present)
        self._failures += 1
        return None if folder is None or self._failures > _FAILURES_MAX else self._path(present, folder)

    def _path(self, present: Recording, folder: Path) -> Path:
        """The log after the present one, by its number."""
        first, number = numbered(present.path)
        self._number = max(self._number, number) + 1
        return named(first, self._number, folder / present.path.name)

    def _accounts(self, present: Recording) -> list[_Account]:
        return [*self._closed, *map(_Account.of, (*self.earlier, present))]

    def other_folder(self, present: Recording) -> Path | None:
        """The folder on another disk; None if there is none, or if the log is there already."""
        return None if self._fallback == present.path.parent else self._fallback

    def over(self, last: Recording) -> bool:
        """Whether nothing of these logs is still to be written."""
        removed = self._removing is None or not self._removing.is_alive()
        return removed and all(each.log is None or each.log.over for each in (*self.earlier, last))

    def let_go(self, last: Recording) -> None:
        """Stop waiting for the disk: what it has not closed by now has failed."""
        last.confirm(host_now())
        for each in (last, *self.earlier):
            each.in_flight.release()
        if last.ending.failure is None:
            last.ending.failure = last.opening.unclosed()

    def finished(self, last: Recording, unpublished: int) -> RecordingFinished:
        """Forget all logs.

        Args:
            last: the last log of the recording.
            unpublished: number of messages that subscribers were too slow for.

        Returns:
            The report of the recording's end.
        """
        for each in (last, *self.earlier):
            each.in_flight.forget()
        *before, end = self._accounts(last)
        failure = last.ending.failure or next((each.gone for each in before if each.gone is not None), None)
        told = self.progress(last)
        report = RecordingFinished(
            path=last.path,
            bytes=end.part.bytes,
            unpublished=unpublished,
            counts=told.counts,
            first_pulse=told.first_pulse,
            pauses=told.pauses,
            earlier=tuple(each.part for each in before),
            failure=None if failure is None else RecorderFailed.of(failure),
            trouble="; ".join(each.trouble for each in (*before, end) if each.trouble),
        )
        self.begin()
        return report
