"""Decides what became of the pulses between two whole frames of one camera: lost, missed, damaged or absent.

The frame ids tell how many frames the camera *took* between two that arrived, but not at which pulses. The cause of a
single missing frame is therefore exact. If several in a row are missing for different causes, the number of each cause
is exact, and their order is a convention: damaged where the arrival fits best, then lost, then missed.

From a reconnection to the first frame after it the camera counts as absent. In its very first connection, if the ids
plausibly began at 1, the pulses before the first frame are judged by its id, so that a camera that fails at the first
pulses is not taken for an absent one.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from rig.clocks import HostNs
from rig.frame import FrameRecord, FrameStatus
from rig.health import CameraCounters
from triggering.pairing.camera.frame_ids import id_step, overruns_between
from triggering.pairing.outcomes import NO_FRAME, OVERRUN, Outcome
from triggering.timeline.pulse_train import PulseTrain

_EXTRA_GAIN: Final = 0.2
_LATENCY_GAIN: Final = 0.05
#: Damaged arrivals kept until their pulse is decided; only a camera that sends nothing else has more.
_MOST_DAMAGED: Final = 64
#: Pulses remembered because they were decided as lost without proof.
_MOST_PRESUMED: Final = 10_000


@dataclass(slots=True)
class Gap:
    """A span on the common time line in which a camera delivered no whole frame.

    Attributes:
        start: time of the frame before the gap; before the first frame of a connection, time of the connection.
        end: time of the frame after the gap, or of the disconnection.
        taken: frames that the camera took in the gap and that are not assigned to pulses yet.
        holes: all frames that it took in the gap.
        damaged: host times of damaged arrivals in the gap that are not assigned to pulses yet.
        broken: the ids tell nothing about this gap: the camera was gone, silent or reset.
        anchored: both ends are frames, so that ids and times can prove pulses of which no camera delivered a frame.
        overruns: triggers in the gap that the camera saw while it was busy; those pulses are missed.
    """

    start: HostNs
    end: HostNs
    taken: int = 0
    holes: int = 0
    damaged: list[HostNs] = field(default_factory=list)
    broken: bool = False
    anchored: bool = True
    overruns: int = 0

    def settle(self, time: HostNs, rivals: Sequence[HostNs], matcher: "DamageMatcher") -> Outcome:
        """Decide what became of the pulse at `time` in this camera.

        Args:
            time: time of the pulse; pulses are decided in the order of time.
            rivals: times of the later pulses in this gap, in order.
            matcher: assigns damaged arrivals to pulses.
        """
        if time < self.start:
            return NO_FRAME[FrameStatus.ABSENT]
        if self.damaged and (self.broken or self.taken > 0) and matcher.match(self.damaged, time, rivals):
            self.taken -= 1
            return NO_FRAME[FrameStatus.DAMAGED]
        if self.broken:
            return NO_FRAME[FrameStatus.ABSENT]
        if self.taken > len(self.damaged):
            self.taken -= 1
            return NO_FRAME[FrameStatus.LOST]
        if self.overruns > 0:
            self.overruns -= 1
            return OVERRUN
        return NO_FRAME[FrameStatus.MISSED]


class DamageMatcher:
    """Assigns the damaged arrivals of one camera to pulses; often only the host time of an arrival is known.

    A damaged frame is handed over later than a whole one: when the next frame begins, or after a timeout. The matcher
    begins with half a period and learns the delay wherever only one pulse is possible.

    Args:
        period_ns: nominal period of the pulses.
        counters: for counting arrivals that belong to no pulse.

    Attributes:
        latency_ns: typical time from trigger to arrival of this camera's whole frames.
    """

    def __init__(self, period_ns: float, counters: CameraCounters) -> None:
        self.latency_ns = 0.0
        self._extra_ns = period_ns / 2
        self._counters = counters

    def whole(self, latency_ns: int) -> None:
        """Enter the time from the trigger of a whole frame to its arrival."""
        gain = _LATENCY_GAIN if self.latency_ns else 1.0
        self.latency_ns += gain * (latency_ns - self.latency_ns)

    def trigger_of(self, arrival: HostNs) -> float:
        """Likely trigger time of a damaged arrival."""
        return arrival - self.latency_ns - self._extra_ns

    def arrival_of(self, trigger: HostNs) -> HostNs:
        """Likely arrival of a damaged frame whose trigger time is known."""
        return HostNs(round(trigger + self.latency_ns + self._extra_ns))

    def match(self, damaged: list[HostNs], time: HostNs, rivals: Sequence[HostNs]) -> bool:
        """Take the first damaged arrival out of the list, if it belongs to the pulse at `time`.

        Args:
            damaged: host times of arrivals, in order.
            time: time of the pulse.
            rivals: times of the later pulses to which the arrivals may belong, in order.

        Returns:
            Whether it belongs to this pulse.
        """
        while damaged and damaged[0] < time:
            del damaged[0]
            self._counters.unassigned += 1
        if not damaged:
            return False
        likely = self.trigger_of(damaged[0])
        if not rivals and len(damaged) == 1:
            self._extra_ns += _EXTRA_GAIN * (likely - time)
        # If this pulse gets none, each arrival must still have a later pulse of its own that fired before it.
        others_fit = all(index < len(rivals) and rivals[index] < arrival for index, arrival in enumerate(damaged))
        if others_fit and abs(likely - time) > abs(likely - rivals[0]):
            return False
        del damaged[0]
        return True


class Gaps:
    """The gaps of one camera: the ended ones, and the running one since the last whole frame.

    Args:
        train: the rhythm of the pulses.
        counters: totals of the camera.

    Attributes:
        matcher: assigns damaged arrivals to pulses.
        broken: the ids tell nothing about the running gap.
    """

    def __init__(self, train: PulseTrain, counters: CameraCounters) -> None:
        self._train, self._counters = train, counters
        self.matcher = DamageMatcher(train.period_ns, counters)
        self.broken = False
        self._ended: deque[Gap] = deque()
        self._damaged: list[HostNs] = []
        self._settled_damaged = 0
        self._presumed: deque[HostNs] = deque(maxlen=_MOST_PRESUMED)

    def begin(self, *, broken: bool) -> None:
        """Begin the first gap of an epoch."""
        self.broken = broken
        self._begin_running()

    def end_epoch(self, start: HostNs, end: HostNs) -> None:
        """End the running gap, which began at `start`, with a disconnection at `end`."""
        self._ended.append(Gap(start, end, damaged=self._damaged, broken=True, anchored=False))
        self._damaged = []

    def add_damaged(self, host: HostNs) -> None:
        """Enter a damaged arrival that came at `host`."""
        if len(self._damaged) >= _MOST_DAMAGED:
            del self._damaged[0]
            self._counters.unassigned += 1
        self._damaged.append(host)

    def first_frame(self, since: HostNs, record: FrameRecord, time: HostNs) -> None:
        """End the running gap, which began with the connection at `since`, by the first whole frame, taken at `time`.

        The id of the frame counts the frames before it, if the ids may have begun at 1.
        """
        taken = record.frame_id - 1
        if self.broken or not 0 <= taken <= self._most_steps(time - since):
            self.broken, taken = True, 0
        self._end_running(since, time, taken, anchored=False)

    def next_frame(self, last: FrameRecord, last_time: HostNs, record: FrameRecord, time: HostNs) -> None:
        """End the running gap, from the frame `last` at `last_time` to the whole frame `record` at `time`."""
        step = id_step(last.frame_id, record.frame_id, record.id_modulus)
        if not 0 < step <= self._most_steps(time - last_time):
            self._counters.restarts += 1
            self.broken, step = True, 1
        gap = self._end_running(last_time, time, step - 1, anchored=not self.broken)
        if gap.anchored:
            gap.overruns = overruns_between(last, record, step)
            self._counters.overruns += gap.overruns

    def at(self, time: HostNs) -> Gap | None:
        """The gap in which `time` lies, None if its end is not known yet. Earlier gaps are dropped."""
        self.forget_until(time)
        return self._ended[0] if self._ended else None

    def forget_until(self, time: HostNs) -> None:
        """Drop the gaps that ended by `time`: all pulses in them are decided."""
        while self._ended and self._ended[0].end <= time:
            done = self._ended.popleft()
            if done.anchored and done.taken > 0:
                self._counters.unexplained += done.taken
            self._counters.unassigned += len(done.damaged)

    def has_damaged(self) -> bool:
        """Whether there are damaged arrivals that are not assigned to a pulse yet."""
        return bool(self._damaged) or any(gap.damaged for gap in self._ended)

    @property
    def has_running_damaged(self) -> bool:
        """Whether there are damaged arrivals in the running gap that are not assigned to a pulse yet."""
        return bool(self._damaged)

    def take_damaged(self, time: HostNs, rivals: Sequence[HostNs]) -> bool:
        """Assign a damaged arrival of the running gap to the pulse at `time`, if one belongs to it.

        Args:
            time: time of the pulse.
            rivals: times of the later pulses without a frame of the camera, in order.
        """
        taken = bool(self._damaged) and self.matcher.match(self._damaged, time, rivals)
        self._settled_damaged += taken
        return taken

    def presume_lost(self, time: HostNs) -> None:
        """Remember a pulse in the running gap that is decided although the gap has not ended."""
        self._presumed.append(time)

    # -- details -------------------------------------------------------------------------------------------------

    def _begin_running(self) -> None:
        self._damaged = []
        self._presumed.clear()
        self._settled_damaged = 0

    def _end_running(self, start: HostNs, end: HostNs, taken: int, *, anchored: bool) -> Gap:
        """End the running gap by the frame at `end`; the camera took `taken` frames in it. A new gap begins there."""
        # Frames may come so late that later pulses are decided already; those lie in the gap that begins now.
        presumed, later = 0, []
        if self._presumed:
            presumed = sum(pulse < end - self._train.tolerance_ns for pulse in self._presumed)
            later = [pulse for pulse in self._presumed if pulse > end + self._train.tolerance_ns]
        left = taken - self._settled_damaged - presumed
        # Damaged arrivals are certain; pulses decided as lost without proof are not.
        least = max(0, min(len(self._damaged), taken - self._settled_damaged))
        if left < least and anchored:
            self._counters.contradicted += min(least - left, presumed)
        gap = Gap(start, end, max(left, least), taken, self._damaged, self.broken, anchored)
        self._ended.append(gap)
        self._begin_running()
        self._presumed.extend(later)
        self.broken = False
        return gap

    def _most_steps(self, span_ns: int) -> float:
        """Upper limit of the frames that a camera can take in a time, even if the rate is off."""
        return 1.5 * span_ns / self._train.period_ns + 1.5
