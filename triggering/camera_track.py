"""One camera on the common time line: its clock, its ids, and what they prove about the pulses in between.

Evidence is per epoch: a new connection has another clock and other ids. Until the first frame after a
reconnection the camera counts as absent. Only the first connection of all is judged by its ids from the very
beginning, if they plausibly began at 1: a camera that fails at the first pulse must not go by as absent.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final

from rig.clocks import ClockLatch, DeviceNs, HostNs
from rig.frame import FrameStatus, Record
from triggering.block_ids import id_step
from triggering.counters import CameraCounters
from triggering.device_clock import DeviceClock
from triggering.gaps import DamageMatcher, Gap
from triggering.pulse_train import PulseTrain
from triggering.pulses import NO_FRAME, Outcome

#: Damaged arrivals that wait for their pulse; more can only come from a camera that sends nothing else.
_MOST_DAMAGED: Final = 64


class CameraTrack:
    """What is known of one camera.

    Args:
        train: the rhythm of the pulses.
        tolerance_ns: frames this close in time are of one pulse.

    Attributes:
        clock: the camera's clock of this epoch.
        counters: totals since the start.
        epoch: number of the present connection, 0 before the first.
        connected: whether the camera is there.
        silent: it is connected and delivers nothing while others do.
        unanswered: pulses decided without this camera since its last sign of life.
        alive: host time of the last sign of life: a trigger time or the connection.
    """

    def __init__(self, train: PulseTrain, tolerance_ns: int) -> None:
        self.clock = DeviceClock()
        self.counters = CameraCounters()
        self.epoch = 0
        self.connected = False
        self.silent = False
        self.unanswered = 0
        self.alive = HostNs(0)
        self._train, self._tolerance_ns = train, tolerance_ns
        self._matcher = DamageMatcher(train.period_ns, self.counters)
        self._gaps: deque[Gap] = deque()
        self._since = HostNs(0)
        self._known_until = HostNs(0)
        self._connections = 0
        self._last: Record | None = None
        self._last_time: HostNs | None = None
        # The running gap: since the last frame, its end not yet known.
        self._broken = False
        self._damaged: list[HostNs] = []
        self._settled_damaged = 0
        self._settled_unseen = 0  # decided as lost or absent without a proof

    @property
    def latency_ns(self) -> float:
        """Typical time from trigger to arrival."""
        return self._matcher.latency_ns

    @property
    def delivers(self) -> bool:
        """It has delivered a frame since it was connected."""
        return self.connected and self._last_time is not None

    # -- what the camera says ------------------------------------------------------------------------------------

    def connect(self, epoch: int, host: HostNs) -> None:
        """A new epoch: clock, ids and times have nothing to do with the last one's."""
        if self.connected:
            self.disconnect(host)
        if self._connections > 0:
            self.clock = DeviceClock()
        self._connections += 1
        self.epoch, self.connected, self.silent = epoch, True, False
        self._since = self.alive = host
        self._last = self._last_time = None
        self._broken = self._connections > 1
        self._begin_running_gap()

    def disconnect(self, host: HostNs) -> None:
        """The camera is gone: what it has not delivered up to now, it never will."""
        if not self.connected:
            return
        start = self._since if self._last_time is None else self._last_time
        self._gaps.append(Gap(start, host, damaged=self._damaged, broken=True, anchored=False))
        self._known_until = max(self._known_until, host)
        self.connected = self.silent = False
        self._damaged = []

    def latch(self, latch: ClockLatch) -> None:
        """A reading of the camera's clock."""
        steps = self.clock.steps
        self.clock.latch(latch)
        if self.clock.steps != steps:
            # Times before and after the step cannot be compared; the next frame begins anew.
            self.counters.clock_steps += 1
            self._last = self._last_time = None
            self._broken = True

    def damaged(self, host: HostNs, device: DeviceNs | None = None) -> None:
        """Something arrived that is no whole frame.

        Args:
            host: when.
            device: the camera's clock at its trigger, if it can be told.
        """
        if device is not None and self.clock.known:
            host = self._matcher.arrival_of(self.clock.to_host(device))
        if len(self._damaged) >= _MOST_DAMAGED:
            del self._damaged[0]
            self.counters.unassigned += 1
        self._damaged.append(host)
        self.alive = max(self.alive, HostNs(round(self._matcher.trigger_of(host))))
        self.unanswered = 0
        if self.silent:
            self.silent, self._broken = False, True

    def anchor(self, record: Record) -> HostNs | None:
        """Trigger time of a whole frame on the common time line, None if it cannot be told."""
        if not self.clock.known:
            self._not_anchored()
            return None
        time = self.clock.to_host(record.device_time)
        if self._last_time is None and self.clock.uncertainty_at(record.device_time) > self._tolerance_ns / 2:
            self._not_anchored()
            return None
        if time > record.host_time + self._tolerance_ns:
            self._implausible(record)
            return None
        return time

    def follow(self, record: Record, time: HostNs) -> bool:
        """Take a whole frame, triggered at `time`, as evidence of what happened since the last one.

        Returns:
            False if the frame is not newer than the last one and so belongs nowhere.
        """
        if self.silent:
            self.silent, self._broken = False, True
        last, last_time = self._last, self._last_time
        if last is None or last_time is None:
            taken = self._taken_at_first(record, time)
            self._gaps.append(self._end_running_gap(self._since, time, taken, anchored=False))
        elif time > last_time:
            taken = self._taken_since(last, last_time, record, time)
            gap = self._end_running_gap(last_time, time, taken, anchored=not self._broken)
            gap.overruns = _overruns(last, record, taken + 1) if gap.anchored else 0
            self.counters.overruns += gap.overruns
            self._gaps.append(gap)
        else:
            if record.frame_id == last.frame_id:
                self.counters.duplicate += 1
            else:
                self._implausible(record)
            return False
        self._last, self._last_time = record, time
        self._known_until = self.alive = time
        self._matcher.whole(record.host_time - time)
        return True

    # -- what it proves ------------------------------------------------------------------------------------------

    def may_deliver(self, time: HostNs) -> bool:
        """Whether a frame of a pulse at `time` may still come."""
        expected = time >= self._since - self._tolerance_ns and time >= self._known_until
        return expected and self.connected and not self.silent

    def settle(self, time: HostNs, rivals: Sequence[HostNs]) -> Outcome:
        """Decide a pulse for which the camera has delivered no whole frame. Pulses come in the order of time.

        Args:
            time: time of the pulse.
            rivals: times of the later pulses before the camera's next frame, in order.
        """
        gap = self.gap_after(time)
        if gap is not None:
            return gap.settle(time, rivals, self._matcher)
        if not self.connected or time < self._since:
            return NO_FRAME[FrameStatus.ABSENT]
        if self._damaged and self._matcher.match(self._damaged, time, rivals):
            self._settled_damaged += 1
            return NO_FRAME[FrameStatus.DAMAGED]
        self._settled_unseen += 1
        self.unanswered += time > self.alive
        if self._last_time is None or self.silent:
            return NO_FRAME[FrameStatus.ABSENT]
        self.counters.presumed += 1
        return NO_FRAME[FrameStatus.LOST]

    def gap_after(self, time: HostNs) -> Gap | None:
        """The gap in which `time` lies, None if its end is not known yet. Earlier gaps are done with."""
        self.forget_until(time)
        return self._gaps[0] if self._gaps else None

    def forget_until(self, time: HostNs) -> None:
        """All pulses up to `time` are decided."""
        while self._gaps and self._gaps[0].end <= time:
            done = self._gaps.popleft()
            if done.anchored and done.taken > 0:
                self.counters.unexplained += done.taken
            self.counters.unassigned += len(done.damaged)

    def has_damaged(self) -> bool:
        """Whether damaged arrivals wait for their pulse."""
        return bool(self._damaged) or any(gap.damaged for gap in self._gaps)

    # -- details -------------------------------------------------------------------------------------------------

    def _implausible(self, record: Record) -> None:
        """A whole frame from the future, or older than the one before it: something came, but when is unknown."""
        self.counters.implausible += 1
        self.damaged(record.host_time)

    def _not_anchored(self) -> None:
        """A frame that cannot be placed: whatever its id would prove, it is no longer from the beginning."""
        self.counters.unanchored += 1
        if self._last_time is None:
            self._broken = True

    def _begin_running_gap(self) -> None:
        self._damaged = []
        self._settled_damaged = self._settled_unseen = self.unanswered = 0

    def _end_running_gap(self, start: HostNs, end: HostNs, taken: int, *, anchored: bool) -> Gap:
        """The gap up to the frame at `end`, in which the camera took `taken` frames; a new gap begins there."""
        left = taken - self._settled_damaged - self._settled_unseen
        # Arrivals are facts, presumptions are not.
        least = max(0, min(len(self._damaged), taken - self._settled_damaged))
        if left < least and anchored:
            self.counters.contradicted += min(least - left, self._settled_unseen)
        gap = Gap(start, end, max(left, least), taken, self._damaged, self._broken, anchored)
        self._begin_running_gap()
        self._broken = False
        return gap

    def _taken_at_first(self, record: Record, time: HostNs) -> int:
        """Frames taken before the first one that came: by its id, if the ids may have begun at 1."""
        before = record.frame_id - 1
        if self._broken or not 0 <= before <= self._most_steps(time - self._since):
            self._broken = True
            return 0
        return before

    def _taken_since(self, last: Record, last_time: HostNs, record: Record, time: HostNs) -> int:
        """Frames taken between the last one that came and this one."""
        step = id_step(last.frame_id, record.frame_id, record.id_modulus)
        if not 0 < step <= self._most_steps(time - last_time):
            self.counters.restarts += 1
            self._broken = True
            return 0
        return step - 1

    def _most_steps(self, span_ns: int) -> float:
        """More frames than this a camera cannot have taken in a time, however odd the rate."""
        return 1.5 * span_ns / self._train.period_ns + 1.5


def _overruns(last: Record, record: Record, frames: int) -> int:
    """Triggers between two whole frames, of which the camera made no frame: it took so many `frames`."""
    if record.trigger_count < 0 or last.trigger_count < 0:
        return 0
    return max(0, record.trigger_count - last.trigger_count - frames)
