"""The recordings that wait: to be measured, to have a corrected name written, and to be copied."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

from recorder.log.write_lock import is_being_written
from rig.errors import StateForbidsError
from rig.events import Event, Level
from rig.phrase import phrase
from rig.settings.model import RigSettings
from service.measuring.copies import Copies
from service.measuring.results import is_outdated
from service.measuring.retries import Retries
from service.measuring.waiting import QueueFile, WaitingLogs

_WRITTEN_S: Final = 10.0


class Queues:
    """Any thread may call any method but `retry` and `next`, which are for the thread that does the work.

    Args:
        folder: of the recordings.
        in_use: gives the rig in use.
        tell: takes an event for the live log.

    Attributes:
        measuring: the logs that wait to be measured; a file keeps them.
        names: the results whose files do not say a corrected name: they tell so themselves.
        copies: the recordings that wait to be copied.
    """

    def __init__(self, folder: Path, in_use: Callable[[], RigSettings], tell: Callable[[Event], None]) -> None:
        self._folder, self._in_use, self._tell = folder, in_use, tell
        self._file = QueueFile(folder, tell)
        self.measuring = WaitingLogs(self._file.keep)
        self.names = WaitingLogs()
        self.copies = Copies(folder, in_use, tell)
        self._retries = Retries(folder, in_use)
        self._gone: set[str] = set()  # deleted before they were measured

    def go_on(self) -> None:
        """Let wait what waited in an earlier service."""
        self.measuring.go_on(self._file.read())
        for log in self._folder.glob("*.mcap"):
            self.renamed(log.stem, log)

    def close(self) -> None:
        """Wait until the file is written."""
        self._file.wait(_WRITTEN_S)

    def log(self, recording: str) -> Path:
        """The log of a recording."""
        return self._folder / f"{recording}.mcap"

    def opened(self, log: Path) -> None:
        """A recording writes this log: it comes before those that wait, as people at the hill look at the last jump."""
        if log.parent != self._folder:
            return
        analysis = self._in_use().analysis
        if analysis is not None and analysis.after_recording:
            with suppress(StateForbidsError):  # two thousand wait: this one is measured when somebody asks
                self.measuring.add(log.stem, first=True)
        self.copies.want(log.stem)

    def restored(self, recording: str, log: Path) -> None:
        """A recording is back from the trash: if it was deleted before its turn came, it waits again."""
        if recording in self._gone:
            self._gone.discard(recording)
            with suppress(StateForbidsError):  # two thousand wait: this one is measured when somebody asks
                self.measuring.add(recording)
        self.renamed(recording, log)

    def renamed(self, recording: str, log: Path) -> None:
        """The session of a recording was corrected: the files of its result that name the jumper wait."""
        if log.parent == self._folder and is_outdated(log):
            with suppress(StateForbidsError):  # two thousand wait: a service that starts again finds it
                self.names.add(recording)

    def failed(self) -> None:
        """A log may have failed by survey or poses that have changed meanwhile."""
        self._retries.look_again()

    def retry(self) -> bool:
        """Let the logs wait again that survey or poses kept from being measured, when those have changed.

        Returns:
            Whether there were any.
        """
        queued = []
        with suppress(StateForbidsError):  # two thousand wait: the others are measured when somebody asks
            for recording in self._retries.due():
                self.measuring.add(recording)
                queued.append(recording)
        if not queued:
            return False
        self._file.wait(_WRITTEN_S)
        self._retries.queued(queued)
        text = "survey or poses have changed: {count} recordings that could not be measured by them are measured again"
        said = phrase("event_measured_again", text, count=len(queued))
        self._tell(Event.now(Level.INFO, "analysis", said))
        return True

    def next(self, waiting: WaitingLogs) -> str | None:
        """The first log that is closed; those that are gone do not wait any more."""
        for recording in waiting.ids:
            log = self.log(recording)
            if not log.exists():
                self.drop(recording, waiting)
            elif not is_being_written(log):
                return recording
        return None

    def drop(self, recording: str, waiting: WaitingLogs) -> None:
        """Let a log wait no more; one that was deleted before it was measured is remembered."""
        if waiting is self.measuring and recording in waiting and not self.log(recording).exists():
            self._gone.add(recording)
        waiting.remove(recording)
