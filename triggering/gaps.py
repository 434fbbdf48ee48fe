"""What happened between two whole frames of one camera: how many frames it took in between, and which came damaged.

The ids tell how many frames the camera *took* between two that arrived, not at which of the pulses in between. One
missing pulse has an exact cause. Of several missing in a row with different causes, the number of each is exact and
the order is a convention: damaged ones where their arrival fits best, then lost ones first, missed ones after.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from rig.clocks import HostNs
from rig.frame import FrameStatus
from triggering.counters import CameraCounters
from triggering.pulses import NO_FRAME, OVERRUN, Outcome

_EXTRA_GAIN: Final = 0.2
_LATENCY_GAIN: Final = 0.05


@dataclass(slots=True)
class Gap:
    """Time between two successive signs of a camera on the common time line.

    Attributes:
        start: time of the earlier frame; for the first frame of all, when the camera was connected.
        end: time of the later frame, or of the disconnection.
        taken: frames that the camera took in between and that no pulse accounts for yet.
        holes: frames that it took in between, all of them.
        damaged: host times of damaged arrivals in between that no pulse accounts for yet.
        broken: the ids do not tell anything here (the camera was not there, silent, or began anew).
        anchored: both ends are frames, so that ids and time together can prove pulses that nobody delivered.
        overruns: triggers in between that the camera saw but could not follow; those pulses are missed.
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
        """Decide the pulse at `time`, for which the camera delivered no whole frame.

        Args:
            time: time of the pulse; pulses are decided in the order of time.
            rivals: times of the later pulses of this gap that lack the camera, in order.
            matcher: tells which damaged arrival belongs to which pulse.
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
    """Matches damaged arrivals, of which often only the host time is known, to pulses.

    A damaged frame is handed over later than a whole one: when the next one begins or when a timeout is over. How
    much later is learned wherever there was no choice; until then half a period.

    Args:
        period_ns: nominal period of the pulses.
        counters: where arrivals that no pulse can have caused are counted.

    Attributes:
        latency_ns: typical time from trigger to arrival of this camera's whole frames.
    """

    def __init__(self, period_ns: float, counters: CameraCounters) -> None:
        self.latency_ns = 0.0
        self._extra_ns = period_ns / 2
        self._counters = counters

    def whole(self, latency_ns: int) -> None:
        """A whole frame came so long after its trigger."""
        gain = _LATENCY_GAIN if self.latency_ns else 1.0
        self.latency_ns += gain * (latency_ns - self.latency_ns)

    def trigger_of(self, arrival: HostNs) -> float:
        """Likely trigger time of a damaged arrival."""
        return arrival - self.latency_ns - self._extra_ns

    def arrival_of(self, trigger: HostNs) -> HostNs:
        """Where a damaged arrival stands whose trigger time the camera tells."""
        return HostNs(round(trigger + self.latency_ns + self._extra_ns))

    def match(self, damaged: list[HostNs], time: HostNs, rivals: Sequence[HostNs]) -> bool:
        """Take the first damaged arrival out of the list if it belongs to the pulse at `time`.

        Args:
            damaged: host times of arrivals, in order.
            time: time of the pulse.
            rivals: times of the later pulses that might have caused them, in order.
        """
        while damaged and damaged[0] < time:
            del damaged[0]
            self._counters.unassigned += 1
        if not damaged:
            return False
        likely = self.trigger_of(damaged[0])
        if not rivals and len(damaged) == 1:
            self._extra_ns += _EXTRA_GAIN * (likely - time)
        # Left to the later pulses, every arrival must still find one that fired before it.
        others_fit = all(index < len(rivals) and rivals[index] < arrival for index, arrival in enumerate(damaged))
        if others_fit and abs(likely - time) > abs(likely - rivals[0]):
            return False
        del damaged[0]
        return True
