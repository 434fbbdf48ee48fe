"""One recording as the service follows it: from the order to the recorder's last report of it."""

from collections.abc import Callable
from concurrent.futures import Future
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from rig.api.recordings import Counts, Recording, RecordingState, SessionChange, SessionFields
from rig.api.statement import Level, Statement
from rig.clocks import NS_PER_S, host_now
from rig.errors import SvevError
from rig.transport.recorder_commands import StartRecording
from rig.transport.recorder_reports import RecordingFinished, RecordingProgress, RecordingStarted
from service.recordings.interruption import Interruption
from service.recordings.listing import more_of

#: How a recording ended: the recorder's report, or the error that ended it.
Outcome = RecordingFinished | SvevError


class RecordingInProgress:
    """A recording from the order to the recorder's last report of it.

    Args:
        order: what the recorder was told.
        session: the session fields.
        opened: is answered when the log is open.

    Attributes:
        order: as given; the order for the last log if the recorder died.
        longest_s: it ends after so many seconds, because nobody said how long it is to be; None: somebody did.
        commanded: when it was ordered.
        ids: ids of its logs; there are several if logs failed.
        wanted: path of the log as it was ordered first.
        path: the log, the last one if there are several.
        session: the session fields, later changes included.
        stopping: whether the recorder was told to stop.
        mishap: whether an operator stopped it as soon as it had begun.
        counts: what became of the pulses in all its logs.
        waiting: are answered when the recording is over.
        interruption: the death of its recorder, until it goes on; None: its recorder lives.
        deaths: when its recorders died, on the monotonic clock, s.
    """

    def __init__(self, order: StartRecording, session: SessionFields, opened: "Future[Recording]") -> None:
        self.order, self.session = order, session
        self.longest_s = order.seconds if order.nobody_stops else None
        self.commanded = host_now()
        self.wanted = order.path
        self.ids, self.path = [order.path.stem], order.path
        self.interruption: Interruption | None = None
        self.deaths: list[float] = []
        self._before: dict[str, Counts] = {}
        self._gaps = 0
        self.waiting: list[Future[Outcome]] = []
        self.stopping = self.mishap = False
        self._opened: Future[Recording] | None = opened
        self._ordered = datetime.now(UTC)
        self._started: datetime | None = None
        self.counts, self._pauses = Counts(), 0
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

    def rename(self, path: Path) -> None:
        """Note that the log, which is not open yet, is ordered under another name."""
        self.order = msgspec.structs.replace(self.order, path=path)
        self.ids, self.path = [path.stem], path

    def refuse(self, error: Exception) -> None:
        """Answer the thread that waits for the log to be opened with an error."""
        if self._opened is not None:
            self._opened.set_exception(error)

    def continue_in(self, path: Path) -> None:
        """Note that the log failed and the recording goes on in another one."""
        self.ids.append(path.stem)
        self.path = path

    def go_on(self, order: StartRecording, before: Counts) -> None:
        """Note that a new recorder is told to go on.

        Args:
            order: what it is told.
            before: what became of the pulses in the last log of the dead one.
        """
        self.order = order
        if order.goes_on is not None:
            self._before[order.goes_on.recording] = before
        self._gaps = self._pauses

    def progress(self, report: RecordingProgress) -> None:
        """Note the account so far."""
        self._note_first(report)
        self.counts = Counts.sum([*self._before.values(), report.counts])
        self._pauses = self._gaps + len(report.pauses)

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
        counts = self.counts
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
            more=more_of(self.order.session),
            continues=self.ids[-2] if len(self.ids) > 1 else "",
        )
