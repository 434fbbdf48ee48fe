"""The logs of one recording: when one fails, the recording goes on in another one if there is a place for it."""

from pathlib import Path
from typing import Final

from recorder.live.recording import Recording
from rig.api.recordings import Counts
from rig.clocks import host_now
from rig.errors import FileVanishedError, StorageError, SvevError
from rig.transport.recorder_reports import RecorderFailed, RecordingFinished, RecordingProgress

#: A recording has so many logs at most, however often one of them fails.
_PARTS_MAX: Final = 20


class Parts:
    """The logs of a recording that have failed, before the present one.

    Args:
        fallback: folder on another disk; None: there is none.

    Attributes:
        earlier: those logs, in order.
    """

    def __init__(self, fallback: Path | None) -> None:
        self._fallback = fallback
        self.earlier: list[Recording] = []

    def progress(self, present: Recording) -> RecordingProgress:
        """What became of the pulses in all logs that are there; their numbers go on from log to log."""
        ledgers = [each.ledger for each in (*self.earlier, present) if each.is_there]
        times = (ledger.first_time for ledger in ledgers)
        return RecordingProgress(
            counts=Counts.sum(ledger.counts() for ledger in ledgers),
            first_pulse=next((time for time in times if time is not None), None),
            pauses=tuple(pause for ledger in ledgers for pause in ledger.pauses()),
        )

    def next_path(self, present: Recording, error: SvevError) -> Path | None:
        """Where to go on after a failure; None: nowhere.

        After a file has vanished its own folder is as good as before; it is made again if need be.
        """
        folder: Path | None = None
        if isinstance(error, FileVanishedError):
            folder = present.path.parent
        elif isinstance(error, StorageError):
            folder = self.other_folder(present)
        part = len(self.earlier) + 2
        if folder is None or part > _PARTS_MAX:
            return None
        first = self.earlier[0] if self.earlier else present
        return folder / f"{first.id}-part{part}{present.path.suffix}"

    def other_folder(self, present: Recording) -> Path | None:
        """The folder on another disk; None if there is none, or if the log is there already."""
        return None if self._fallback == present.path.parent else self._fallback

    def over(self, last: Recording) -> bool:
        """Whether nothing of these logs is still to be written."""
        return all(each.log is None or each.log.over for each in (*self.earlier, last))

    def let_go(self, last: Recording) -> None:
        """Stop waiting for the disk: what it has not closed by now has failed."""
        last.confirm(host_now())
        for each in (last, *self.earlier):
            each.release()
        if last.failure is None:
            last.failure = last.unclosed()

    def finished(self, last: Recording, unpublished: int) -> RecordingFinished:
        """Forget all logs.

        Args:
            last: the last log of the recording.
            unpublished: number of messages that subscribers were too slow for.

        Returns:
            The report of the recording's end.
        """
        for each in (last, *self.earlier):
            each.forget()
        gone = next((each.failure for each in self.earlier if isinstance(each.failure, FileVanishedError)), None)
        failure = last.failure or gone
        told = self.progress(last)
        report = RecordingFinished(
            path=last.path,
            bytes=last.part().bytes,
            unpublished=unpublished,
            counts=told.counts,
            first_pulse=told.first_pulse,
            pauses=told.pauses,
            earlier=tuple(each.part() for each in self.earlier),
            failure=None if failure is None else RecorderFailed.of(failure),
            trouble="; ".join(str(each.trouble) for each in (*self.earlier, last) if each.trouble),
        )
        self.earlier.clear()
        return report
