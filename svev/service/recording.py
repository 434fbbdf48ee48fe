"""The recording in progress, as the supervisor sees it."""

from collections.abc import Callable
from concurrent.futures import Future
from datetime import UTC, datetime
from pathlib import Path

from rig.clocks import NS_PER_S
from rig.control import Message
from webpanel.models import (
    Causes,
    Counts,
    Level,
    Recording,
    RecordingOrder,
    RecordingState,
    SessionChange,
    SessionFields,
    Statement,
)


def session_fields(order: RecordingOrder) -> SessionFields:
    """The session fields of an order."""
    return SessionFields(**order.model_dump(include=set(SessionFields.model_fields)))


class RecordingInProgress:
    """From the order to the recorder's last word about it.

    Args:
        path: its log.
        order: what was asked for.
        opened: is answered when the log is open.

    Attributes:
        id: of the recording.
        path: its log.
        session: its session fields, later changes included.
        stopping: whether the recorder was told to stop.
        waiting: whoever waits for the end.
    """

    def __init__(self, path: Path, order: RecordingOrder, opened: "Future[Recording]") -> None:
        self.id, self.path, self.session = path.stem, path, session_fields(order)
        self.waiting: list[Future[str]] = []
        self.stopping = False
        self._opened: Future[Recording] | None = opened
        self._ordered = datetime.now(UTC)
        self._started: datetime | None = None
        self._counts = Counts()
        self._bytes = 0

    @property
    def opening(self) -> bool:
        """Whether the recorder has not yet said that the log is open."""
        return self._opened is not None

    def open(self, report: Message) -> Callable[[], None]:
        """The recorder has opened the log.

        Returns:
            Tells whoever waits for it.
        """
        self._note_first(report)
        opened, self._opened = self._opened, None
        return lambda: opened.set_result(self.view()) if opened is not None else None

    def refuse(self, error: Exception) -> None:
        """The log could not be opened: tell whoever waits for it."""
        if self._opened is not None:
            self._opened.set_exception(error)

    def progress(self, report: Message) -> None:
        """Counts so far."""
        self._note_first(report)
        counts = {name: report[name] for name in ("pulses", "complete", "partial")}
        self._counts = Counts(**counts, causes=Causes(**report["causes"]))

    def grown(self, size: int) -> None:
        """The log has so many bytes."""
        self._bytes = size

    def change_session(self, change: SessionChange) -> None:
        """Take over changed session fields."""
        self.session = self.session.model_copy(update=change.model_dump(exclude_none=True))

    def _note_first(self, report: Message) -> None:
        if self._started is None and (first := report.get("first_pulse_ns")) is not None:
            self._started = datetime.fromtimestamp(int(first) / NS_PER_S, UTC)

    def end(self) -> None:
        """It is over: tell whoever waits."""
        for future in self.waiting:
            future.set_result(self.id)

    def view(self) -> Recording:
        """The recording as the panel shows it."""
        started = self._started or self._ordered
        counts = self._counts
        text = f"recording, {counts.pulses} pulses so far"
        if counts.partial:
            text += f", {counts.partial} of them incomplete"
        verdict = Statement(
            level=Level.WARNING if counts.partial else Level.GOOD,
            code="recording_running",
            text=text,
            values={"pulses": counts.pulses, "partial": counts.partial},
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
