"""One recording as the service follows it: from the order to the recorder's last report of it."""

from collections.abc import Callable
from concurrent.futures import Future
from datetime import UTC, datetime
from pathlib import Path

from rig.clocks import NS_PER_S
from rig.errors import SvevError
from rig.status import Counts, Level, Recording, RecordingState, SessionChange, SessionFields, Statement
from rig.transport.messages import RecordingFinished, RecordingProgress, RecordingStarted

#: How a recording ended: the recorder's report, or the error that ended it.
Outcome = RecordingFinished | SvevError


class RecordingInProgress:
    """A recording from the order to the recorder's last report of it.

    Args:
        path: the log.
        session: the session fields.
        opened: is answered when the log is open.
        longest_s: it ends after so many seconds, because nobody said how long it is to be; None: somebody did.

    Attributes:
        longest_s: as given.
        ids: ids of its logs; there are several if logs failed.
        path: the log, the last one if there are several.
        session: the session fields, later changes included.
        stopping: whether the recorder was told to stop.
        mishap: whether an operator stopped it as soon as it had begun.
        waiting: are answered when the recording is over.
    """

    def __init__(
        self, path: Path, session: SessionFields, opened: "Future[Recording]", longest_s: float | None = None
    ) -> None:
        self.ids, self.path, self.session, self.longest_s = [path.stem], path, session, longest_s
        self.waiting: list[Future[Outcome]] = []
        self.stopping = self.mishap = False
        self._opened: Future[Recording] | None = opened
        self._ordered = datetime.now(UTC)
        self._started: datetime | None = None
        self._counts, self._pauses = Counts(), 0
        self._bytes = 0

    @property
    def id(self) -> str:
        """Id of the log that is being written."""
        return self.ids[-1]

    @property
    def opening(self) -> bool:
        """Whether the recorder has not reported yet that the log is open."""
        return self._opened is not None

    def open(self, report: RecordingStarted) -> Callable[[], None]:
        """Note that the recorder has opened the log.

        Returns:
            A function that answers the thread that waits for it.
        """
        self._note_first(report)
        opened, self._opened = self._opened, None
        return lambda: opened.set_result(self.view()) if opened is not None else None

    def refuse(self, error: Exception) -> None:
        """Answer the thread that waits for the log to be opened with an error."""
        if self._opened is not None:
            self._opened.set_exception(error)

    def continue_in(self, path: Path) -> None:
        """Note that the log failed and the recording goes on in another one."""
        self.ids.append(path.stem)
        self.path = path

    def progress(self, report: RecordingProgress) -> None:
        """Note the account so far."""
        self._note_first(report)
        self._counts, self._pauses = report.counts, len(report.pauses)

    def grown(self, size: int) -> None:
        """Note the size of the log, bytes."""
        self._bytes = size

    def change_session(self, change: SessionChange) -> None:
        """Change session fields."""
        self.session = self.session.model_copy(update=change.model_dump(exclude_none=True))

    def _note_first(self, report: RecordingStarted | RecordingProgress) -> None:
        if self._started is None and report.first_pulse is not None:
            self._started = datetime.fromtimestamp(report.first_pulse / NS_PER_S, UTC)

    def end(self, outcome: Outcome) -> None:
        """Answer the threads that wait for the end."""
        for future in self.waiting:
            future.set_result(outcome)

    def view(self) -> Recording:
        """The recording for the status and the list of recordings."""
        started = self._started or self._ordered
        counts = self._counts
        text = f"recording, {counts.pulses} pulses so far"
        if counts.partial:
            text += f", {counts.partial} of them incomplete"
        if self._pauses:
            text += ", with a pause" if self._pauses == 1 else f", with {self._pauses} pauses"
        verdict = Statement(
            level=Level.WARNING if counts.partial or self._pauses else Level.GOOD,
            code="recording_paused" if self._pauses else "recording_running",
            text=text,
            values={"pulses": counts.pulses, "partial": counts.partial, "pauses": self._pauses},
        )
        return Recording(
            id=self.id,
            state=RecordingState.RECORDING,
            started=started,
            duration_s=round((datetime.now(UTC) - started).total_seconds(), 1),
            bytes=self._bytes,
            counts=counts,
            session=self.session,
            verdict=verdict,
        )
