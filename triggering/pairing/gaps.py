"""Decides what became of the pulses between two whole frames of one camera: lost, missed, damaged or absent.

The frame ids tell how many frames the camera *took* between two that arrived, but not at which pulses. The cause of a
single missing frame is therefore exact. If several in a row are missing for different causes, the number of each cause
is exact, and their order is a convention: damaged where the arrival fits best, then lost, then missed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from rig.clocks import HostNs
from rig.frame import FrameStatus
from rig.health import CameraCounters
from triggering.pairing.outcomes import NO_FRAME, OVERRUN, Outcome

_EXTRA_GAIN: Final = 0.2
_LATENCY_GAIN: Final = 0.05


@dataclass(slots=True)
class Gap:
    """A span on the common time line in which a camera delivered no whole frame.

    Attributes:
        start: time of the frame before; before the first frame of a connection, time of the connection.
        end: time of the frame behind, or of the disconnection.
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
