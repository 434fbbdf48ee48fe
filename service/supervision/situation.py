"""The situation of the service: everything that decides what it does next, as one frozen value.

Only the supervisor's thread replaces it (`service.supervision.decide`). Any thread may read it; what it reads is of one
moment.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from rig.api.statement import Statement
from rig.api.status import State
from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import SvevError
from rig.phrase import Phrase, phrase
from rig.settings.model import RigSettings
from rig.settings.region import RegionLimits
from rig.transport.process_table import BackOff
from rig.transport.recorder_commands import Calibration
from service.processes.seen import Seen
from service.recordings.in_progress import RecordingInProgress
from service.status.statements import failed

if TYPE_CHECKING:
    from concurrent.futures import Future

#: Between reports farther apart than this the rate is not known.
_STALE_S: Final = 3.0
#: After this time without a report the service does not call itself healthy any more.
_REPORT_LATE_S: Final = 10.0
#: If a turn takes longer than this, the loop hangs.
_TURN_LATE_S: Final = 5.0
#: Longest wait for the first complete triplets after the cameras have answered: recordings then begin complete.
WARM_S: Final = 2.0


@dataclass(frozen=True, slots=True)
class Moment:
    """One moment on the clocks.

    Attributes:
        host: on the monotonic clock.
        utc: UTC.
    """

    host: HostNs
    utc: datetime

    @classmethod
    def now(cls) -> "Moment":
        """The present moment."""
        return cls(host_now(), datetime.now(UTC))

    @property
    def s(self) -> float:
        """On the monotonic clock, s."""
        return self.host / NS_PER_S


@dataclass(frozen=True, slots=True)
class Phase:
    """A state.

    Attributes:
        state: the state.
        since: when it began, UTC.
        number: counts up with every change of state; higher than any number of an earlier run of the service.
        began: when it began, on the monotonic clock, s.
    """

    state: State
    since: datetime
    number: int
    began: float

    def age_s(self, now: float) -> float:
        """How long the state has lasted at a moment on the monotonic clock, s."""
        return now - self.began


@dataclass(frozen=True, slots=True)
class RigInUse:
    """The rig in use.

    Attributes:
        rig: it.
        toml: the text of its file, attached to every log.
        calibration: of its cameras, written into every log; None: not known.
    """

    rig: RigSettings
    toml: str
    calibration: Calibration | None = None


@dataclass(frozen=True, slots=True)
class Goal:
    """What people want of the rig.

    Attributes:
        armed: it is to be armed.
        least_cameras: so many cameras are enough.
    """

    armed: bool
    least_cameras: int


@dataclass(frozen=True, slots=True)
class Fault:
    """The fault of the rig, if it has one, and when to try again.

    Attributes:
        statement: the fault in words; None: there is none.
        cause: the error behind it.
        complaint: the error with which the recorder said that it is about to end.
        back_off: how often the recorder died or could not be started, and how long to wait after that.
        again_at: when to try again, on the monotonic clock, s.
    """

    statement: Statement | None = None
    cause: SvevError | None = None
    complaint: SvevError | None = None
    back_off: BackOff = field(default_factory=BackOff)
    again_at: float = 0.0

    def failed(self, error: SvevError, lived_s: float, now: float, *, hurry: bool) -> tuple["Fault", Phrase]:
        """Setting up failed, or the recorder died.

        Args:
            error: the error; a complaint of the recorder, if there is one, is used instead, since it says more.
            lived_s: how long the rig had worked, s.
            now: on the monotonic clock, s.
            hurry: try again at once, because a recording is to go on.

        Returns:
            The fault; and what happened and when it is tried again, in words.
        """
        back_off, cause = self.back_off.died(lived_s), self.complaint or error
        wait_s = 0.0 if hurry else back_off.wait_s
        fault = replace(self, statement=failed(cause, wait_s), cause=cause, back_off=back_off, again_at=now + wait_s)
        if not wait_s:
            return fault, phrase("event_starting_at_once", "{why}; starting again at once", why=cause.said)
        text = "{why}; starting again in {seconds:g} s"
        return fault, phrase("event_starting_again", text, why=cause.said, seconds=wait_s)

    def cleared(self) -> "Fault":
        """It is over, or is being tried again."""
        return replace(self, statement=None, cause=None, complaint=None)

    def hurried(self) -> "Fault":
        """It is tried again at once, because a person asked for it."""
        return Fault(back_off=self.back_off.forgotten())


@dataclass(frozen=True, slots=True)
class Settling:
    """How far arming is.

    Attributes:
        began: when arming began, on the monotonic clock, s.
        patience_s: longest wait for the first complete triplets, s.
        tried_at: when all cameras had answered or failed, likewise; None: they have not.
    """

    began: float = 0.0
    patience_s: float = WARM_S
    tried_at: float | None = None


@dataclass(frozen=True, slots=True)
class Trial:
    """A region of a camera that is being tried.

    Attributes:
        before: what was in use.
        camera: whose region it is.
        said: the region in words.
        present: indices of the cameras that were connected, and of this one.
        warm: whether complete triplets came.
        answer: is answered when the rig is armed with the region, or begins to go back.
    """

    before: RigInUse
    camera: str
    said: Phrase
    present: tuple[int, ...]
    warm: bool
    answer: "Future[None]"


@dataclass(frozen=True, slots=True)
class Recordings:
    """The recording in progress, of which there is at most one, and what is known of the last one.

    Attributes:
        current: the recording in progress, or one whose log is being opened.
        last: id of the recording that ended last.
        notice: why it ended early, until another one starts.
        armed_at: when the rig was armed, on the monotonic clock, s.
        emptied_at: since when memory can hold anything for the next recording, likewise: the last one took the rest.
    """

    armed_at: float
    emptied_at: float
    current: RecordingInProgress | None = None
    last: str | None = None
    notice: Statement | None = None

    @property
    def opening(self) -> bool:
        """Whether a log is being opened: the recording is ordered, and the state is not `RECORDING` yet."""
        return self.current is not None and self.current.opening


@dataclass(frozen=True, slots=True)
class PulseRate:
    """The rate of the pulses, by the recorder's reports of how many have come.

    Attributes:
        count: number of pulses at the last report.
        at: when that came, on the monotonic clock, s; None: none came yet.
        rate_hz: pulses per second; None: not known.
        arriving: whether pulses came between the last two reports, or before the first.
    """

    count: int = 0
    at: float | None = None
    rate_hz: float | None = None
    arriving: bool = False

    def counted(self, pulses: int, now: float) -> "PulseRate":
        """The rate after another report.

        Args:
            pulses: number of pulses so far.
            now: time of the report on the monotonic clock, s.
        """
        rate_hz = self.rate_hz
        if self.at is not None and now > self.at and pulses >= self.count:
            seconds = now - self.at
            rate_hz = (pulses - self.count) / seconds if seconds < _STALE_S else None
        return PulseRate(pulses, now, rate_hz, arriving=pulses > self.count)


@dataclass(frozen=True, slots=True)
class Heard:
    """What the recorder has said.

    Attributes:
        at: when it said something last, or when there was no recorder, on the monotonic clock, s.
        pulses: the rate of the pulses.
        limits: which regions cameras take, by name, as those that were connected have said.
    """

    at: float
    pulses: PulseRate = field(default_factory=PulseRate)
    limits: Mapping[str, RegionLimits] = field(default_factory=lambda: MappingProxyType({}))


@dataclass(frozen=True, slots=True)
class Loop:
    """The supervisor's loop.

    Attributes:
        enduring: whether to try again when setting up failed or the recorder died; otherwise it ends then.
        turned_at: when its last turn ended, on the monotonic clock, s.
        ends_by: when it ends, even if a recording is not closed by then, likewise; None: nobody wants it to end.
        failure: the error that ended it.
    """

    enduring: bool
    turned_at: float
    ends_by: float | None = None
    failure: Exception | None = None


@dataclass(frozen=True, slots=True)
class Situation:
    """Everything that decides what the service does next.

    Attributes:
        phase: the state and its beginning.
        goal: what people want.
        in_use: the rig.
        seen: its processes, as they were last seen.
        heard: what the recorder has said.
        fault: why it is not armed.
        settling: how far arming is.
        trial: a region that is being tried; None: none is.
        recordings: the one in progress, and the last one.
        loop: the supervisor's loop.
    """

    phase: Phase
    goal: Goal
    in_use: RigInUse
    seen: Seen
    heard: Heard
    fault: Fault
    settling: Settling
    trial: Trial | None
    recordings: Recordings
    loop: Loop

    @classmethod
    def idle(cls, in_use: RigInUse, at: Moment, *, enduring: bool = True) -> "Situation":
        """The situation of a service that begins."""
        return cls(
            phase=Phase(State.IDLE, at.utc, int(at.utc.timestamp()), at.s),
            goal=Goal(armed=False, least_cameras=in_use.rig.least_cameras),
            in_use=in_use,
            seen=Seen(),
            heard=Heard(at.s),
            fault=Fault(),
            settling=Settling(),
            trial=None,
            recordings=Recordings(at.s, at.s),
            loop=Loop(enduring, at.s),
        )

    @property
    def state(self) -> State:
        """The state alone."""
        return self.phase.state

    @property
    def answering(self) -> bool:
        """Whether the loop turns and the recorder, if there should be one, reports."""
        now = time.monotonic()
        return now < self.loop.turned_at + _TURN_LATE_S and now <= self.heard.at + _REPORT_LATE_S
