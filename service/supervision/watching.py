"""Watches a running rig for the supervisor: pulses, alarms, signs of life of the recorder, cameras after arming."""

import time
from collections.abc import Callable, Mapping
from typing import Final

from rig.api.statement import Statement
from rig.events import COMPUTER, Event, Level
from rig.health import Health
from rig.settings.model import RigSettings
from rig.settings.trigger import ExternalTrigger
from rig.transport.recorder_reports import RecorderHealth, RecorderReport
from service.alarms.keeper import AlarmKeeper
from service.processes.rig_processes import ANALYSIS, TRIGGER, RigProcesses
from service.status.statements import no_camera, too_few_cameras, too_slow, wrong_rate
from service.supervision.overload import Overload
from triggering.timeline.steady_rate import SteadyRate

#: Between reports farther apart than this the rate is not known.
_STALE_S: Final = 3.0


class PulseRate:
    """Measures the pulse rate from the recorder's reports of how many pulses have come.

    Attributes:
        rate_hz: pulses per second; None: not known.
        arriving: whether pulses came between the last two reports, or before the first.
    """

    def __init__(self) -> None:
        self._count = 0
        self._at: float | None = None
        self.rate_hz: float | None = None
        self.arriving = False

    def count(self, pulses: int, now: float) -> None:
        """Enter a report.

        Args:
            pulses: number of pulses so far.
            now: time of the report on the monotonic clock, s.
        """
        if self._at is not None and now > self._at and pulses >= self._count:
            seconds = now - self._at
            self.rate_hz = (pulses - self._count) / seconds if seconds < _STALE_S else None
        self.arriving = pulses > self._count
        self._count, self._at = pulses, now

    def forget(self) -> None:
        """Start anew: there is no recorder any more."""
        self._at = self.rate_hz = None
        self._count = 0
        self.arriving = False


#: A recorder that has not reported for this time is stuck. Closing a log on a slow disk may take a while.
STUCK_S: Final = 20.0
#: After this time without a report the service does not call itself healthy any more.
_LATE_S: Final = 10.0


class RecorderWatch:
    """Watches the recorder's reports: is it alive, at what rate do pulses come, what is wrong with them.

    The supervisor's thread enters reports; any thread may ask `late`.

    Args:
        rig: the rig.
        tell: takes an event for the live log and for the log of a recording.

    Attributes:
        pulses: the pulse rate.
        alarms: what is wrong.
        overload: whether the computer is too slow.
    """

    def __init__(self, rig: RigSettings, tell: Callable[[Event], None]) -> None:
        self._rig, self._tell = rig, tell
        self.pulses, self.alarms, self.overload = PulseRate(), AlarmKeeper(rig, tell), Overload(rig.trigger.period_ns)
        self._reported = time.monotonic()

    def use(self, rig: RigSettings) -> None:
        """Judge by other exposures or another rate from now on."""
        self._rig, self.overload = rig, Overload(rig.trigger.period_ns)
        self.alarms.use(rig)

    def hear(self, report: RecorderReport) -> None:
        """Enter a report."""
        self._reported = time.monotonic()
        if isinstance(report, RecorderHealth):
            self.pulses.count(report.health.pairing.seen, self._reported)

    def look(self, health: Health, pids: Mapping[str, int], *, still: bool) -> None:
        """Look what is wrong, and whether the computer is too slow; say so when that begins.

        Args:
            health: the recorder's record.
            pids: process ids by row of the process table.
            still: pulses come on request only.
        """
        before = self.overload.cameras
        fetching = {name: pid for name, pid in pids.items() if name not in {ANALYSIS, TRIGGER}}
        self.overload.look(health, fetching, time.monotonic())
        if self.overload.cameras and not before:
            late = [self._rig.cameras[index].name for index in self.overload.cameras]
            self._tell(Event.now(Level.WARNING, COMPUTER, too_slow(late)))
        self.alarms.look(health, self.overload.cameras, still=still)

    def expect_nothing(self) -> None:
        """Note that there is no recorder now, so that no report is late."""
        self._reported = time.monotonic()
        self.pulses.forget()
        self.alarms.forget()
        self.overload.forget()

    def stuck(self, processes: RigProcesses) -> bool:
        """Whether the recorder has sent no report for so long that it has to be ended."""
        return time.monotonic() > max(self._reported, processes.started) + STUCK_S

    @property
    def late(self) -> bool:
        """Whether a report is overdue."""
        return time.monotonic() > self._reported + _LATE_S


#: A camera that has not answered for this time after arming began counts as absent.
_ANSWER_S: Final = 20.0
#: Longest wait for the first complete triplets after the cameras have answered: recordings then begin complete.
_WARM_S: Final = 2.0


class Settling:
    """Decides when arming is done.

    Args:
        rig: the rig.

    Attributes:
        began: when arming began, on the monotonic clock, s.
    """

    def __init__(self, rig: RigSettings) -> None:
        self._rig = rig
        self.began, self._patience_s = 0.0, _WARM_S
        self._tried_at: float | None = None

    def begin(self, now: float, patience_s: float | None = None) -> None:
        """Note that arming begins now.

        Args:
            now: on the monotonic clock, s.
            patience_s: longest wait for the first complete triplets, s; None: as always.
        """
        self.began, self._tried_at = now, None
        self._patience_s = _WARM_S if patience_s is None else patience_s

    def settled(self, processes: RigProcesses) -> bool:
        """Whether every camera has answered or failed, and the connected ones have had time for their first frames.

        Pulses that seem to come at another rate than the rig file names get time, too, to be measured better.
        """
        now = time.monotonic()
        tried = all(camera.tried for camera in processes.cameras) or now > self.began + _ANSWER_S
        if not processes.ready or not tried:
            return False
        if self._tried_at is None:
            self._tried_at = now
        lacking = not any(camera.present for camera in processes.cameras)
        sure = _contradicts(self._rig, processes.rate) is not None  # else the rate is told again soon
        return lacking or (processes.warm and sure) or now > self._tried_at + self._patience_s


#: Pulses whose rate differs from the rig file's by more than this share are those of another generator or another file.
_RATE: Final = 0.02


def why_not_armed(rig: RigSettings, processes: RigProcesses | None, least: int) -> Statement | None:
    """What keeps a rig from being armed: too few cameras, or pulses at another rate than the rig file names.

    A generator that stands still is none of it: it may be started later.

    Args:
        rig: the rig.
        processes: its processes; None: there are none.
        least: so many cameras are needed.
    """
    if processes is None:
        return no_camera()
    if sum(camera.present for camera in processes.cameras) < least:
        return too_few_cameras(rig.cameras, processes.cameras, least)
    trigger, rate = rig.trigger, processes.rate
    if rate is not None and _contradicts(rig, rate):
        return wrong_rate(rate.hz, trigger.rate_hz)
    return None


def _contradicts(rig: RigSettings, rate: SteadyRate | None) -> bool | None:
    """Whether pulses of a generator come at another rate than the rig file names; None: it is not measured well."""
    trigger = rig.trigger
    if rate is None or not isinstance(trigger, ExternalTrigger) or "rate_hz" not in trigger.model_fields_set:
        return False
    return rate.contradicts(trigger.rate_hz, _RATE)
