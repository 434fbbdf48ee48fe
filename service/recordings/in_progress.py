"""One recording as the service follows it: from the order to the recorder's last report of it."""

from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from types import MappingProxyType

import msgspec

from rig.api.recordings import Counts, Recording, RecordingState, SessionChange, SessionFields
from rig.api.statement import Level, Statement
from rig.clocks import HostNs, UtcNs
from rig.errors import SvevError
from rig.transport.recorder_commands import StartRecording
from rig.transport.recorder_reports import LogPart, RecordingFinished, RecordingProgress, RecordingStarted
from service.recordings.interruption import Interruption
from service.recordings.listing import more_of, utc

#: How a recording ended: the recorder's report, or the error that ended it.
Outcome = RecordingFinished | SvevError


@dataclass(frozen=True, slots=True)
class Account:
    """The account of the pulses of a recording.

    Attributes:
        started: time of the first pulse; None: none has come yet.
        counts: what became of the pulses in all its logs.
        pauses: stretches of time without a pulse.
        before: the counts of logs of recorders that died, by the ids of these logs.
        pauses_before: the pauses in them.
        parts: the counts of parts that are complete, likewise; the recorder reports them as long as it lives.
    """

    started: datetime | None = None
    counts: Counts = field(default_factory=Counts)
    pauses: int = 0
    before: Mapping[str, Counts] = field(default_factory=lambda: MappingProxyType({}))
    pauses_before: int = 0
    parts: Mapping[str, Counts] = field(default_factory=lambda: MappingProxyType({}))

    def begun(self, first_pulse: UtcNs | None) -> "Account":
        """With the time of the first pulse, if it is new."""
        if self.started is not None or first_pulse is None:
            return self
        return replace(self, started=utc(first_pulse))

    def progressed(self, report: RecordingProgress) -> "Account":
        """After a report of the recorder."""
        counts = Counts.sum([*self.before.values(), report.counts])
        pauses = self.pauses_before + len(report.pauses)
        return replace(self.begun(report.first_pulse), counts=counts, pauses=pauses)

    def gone_on(self, log: str, counts: Counts) -> "Account":
        """After the recorder of a log died, which holds so many pulses."""
        before = MappingProxyType({**self.before, **self.parts, log: counts})
        return replace(self, before=before, pauses_before=self.pauses, parts=MappingProxyType({}))

    def in_next_part(self, log: str, counts: Counts) -> "Account":
        """After a part of the recording is complete, which holds so many pulses."""
        return replace(self, parts=MappingProxyType({**self.parts, log: counts}))


@dataclass(frozen=True, slots=True)
class RecordingInProgress:
    """A recording from the order to the recorder's last report of it.

    Attributes:
        order: what the recorder was told; the order for the last log if the recorder died.
        session: the session fields, later changes included.
        ordered: when it was ordered, UTC.
        commanded: likewise, on the monotonic clock.
        wanted: path of the log as it was ordered first.
        logs: its logs; there are several if logs failed.
        opened: is answered when the log is open; None: it is.
        waiting: are answered when the recording is over.
        stopping: whether the recorder was told to stop.
        mishap: whether an operator stopped it as soon as it had begun.
        account: what became of the pulses.
        size: of the log that is being written, bytes.
        interruption: the death of its recorder, until it goes on; None: its recorder lives.
        deaths: when its recorders died, on the monotonic clock, s.
        first: place of the log among `logs` that has its id: the later ones are its parts.
        size_before: of those parts that are complete, bytes.
    """

    order: StartRecording
    session: SessionFields
    ordered: datetime
    commanded: HostNs
    wanted: Path
    logs: tuple[Path, ...]
    opened: "Future[Recording] | None"
    waiting: tuple["Future[Outcome]", ...] = ()
    stopping: bool = False
    mishap: bool = False
    account: Account = field(default_factory=Account)
    size: int = 0
    interruption: Interruption | None = None
    deaths: tuple[float, ...] = ()
    first: int = 0
    size_before: int = 0

    @property
    def path(self) -> Path:
        """The log that is being written."""
        return self.logs[-1]

    @property
    def id(self) -> str:
        """Its id."""
        return self.logs[self.first].stem

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of all its logs."""
        return tuple(log.stem for log in self.logs)

    @property
    def opening(self) -> bool:
        """Whether the recorder has not reported yet that the log is open."""
        return self.opened is not None

    @property
    def longest_s(self) -> float | None:
        """It ends after so many seconds, because nobody said how long it is to be; None: somebody did."""
        return self.order.seconds if self.order.nobody_stops else None

    def begun(self, report: RecordingStarted) -> "RecordingInProgress":
        """The recorder has opened the log."""
        return replace(self, opened=None, account=self.account.begun(report.first_pulse))

    def renamed(self, path: Path) -> "RecordingInProgress":
        """The log, which is not open yet, is ordered under another name."""
        return replace(self, order=msgspec.structs.replace(self.order, path=path), logs=(path,))

    def continued_in(self, path: Path) -> "RecordingInProgress":
        """The log failed, and the recording goes on in another one."""
        return replace(self, logs=(*self.logs, path), first=len(self.logs), size_before=0)

    def in_next_part(self, path: Path, before: LogPart) -> "RecordingInProgress":
        """The log is as large as a part may be, and the recording goes on in another one."""
        account = self.account.in_next_part(before.path.stem, before.counts)
        size = self.size_before + before.bytes
        return replace(self, logs=(*self.logs, path), account=account, size=0, size_before=size)

    def gone_on(self, order: StartRecording, before: Counts) -> "RecordingInProgress":
        """A new recorder has the order to go on.

        Args:
            order: what it is told.
            before: what became of the pulses in the last log of the dead one.
        """
        account = replace(self.account, pauses_before=self.account.pauses)
        if order.goes_on is not None:
            account = self.account.gone_on(order.goes_on.recording, before)
        resumed = None if self.interruption is None else replace(self.interruption, resumed=True)
        return replace(self, order=order, account=account, interruption=resumed)

    def with_session(self, change: SessionChange) -> "RecordingInProgress":
        """With other session fields."""
        return replace(self, session=self.session.model_copy(update=change.model_dump(exclude_none=True)))

    def view(self, now: datetime) -> Recording:
        """The recording for the status and the list of recordings, at a moment, UTC."""
        started = self.account.started or self.ordered
        counts, pauses = self.account.counts, self.account.pauses
        text = f"recording, {counts.pulses} pulses so far"
        if counts.partial:
            text += f", {counts.partial} of them incomplete"
        if pauses:
            text += ", with a pause" if pauses == 1 else f", with {pauses} pauses"
        verdict = Statement(
            level=Level.WARNING if counts.partial or pauses else Level.GOOD,
            code="recording_paused" if pauses else "recording_running",
            text=text,
            values={"pulses": counts.pulses, "partial": counts.partial, "pauses": pauses},
        )
        return Recording(
            id=self.id,
            state=RecordingState.RECORDING,
            started=started,
            duration_s=round((now - started).total_seconds(), 1),
            bytes=self.size_before + self.size,
            counts=counts,
            session=self.session,
            verdict=verdict,
            more=more_of(self.order.session),
            continues=self.ids[self.first - 1] if self.first else "",
            parts=self.ids[self.first :],
        )
