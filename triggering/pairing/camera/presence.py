"""When one camera was there: its connection, its first frame, and until when its answers prove that it had not gone.

Ids and clocks are compared within one epoch only: a new connection has another clock and other ids.
"""

from typing import Final

from rig.clocks import NS_PER_S, HostNs
from triggering.timeline.pulse_train import PulseTrain

#: A newly connected camera may take this long to its first frame.
FIRST_NS: Final = NS_PER_S // 2


class Presence:
    """The connection of one camera.

    Args:
        train: the rhythm of the pulses.

    Attributes:
        epoch: number of the present connection, 0 before the first.
        connected: whether the camera is connected.
        since: beginning of the epoch.
        first: trigger time of the epoch's first whole frame; None before it.
        seen: the camera was there until then: every frame that it triggered before has come, or is lost.
        left: `seen` at the end of the last epoch.
        final_until: no whole frame that was triggered before can come any more.
    """

    def __init__(self, train: PulseTrain) -> None:
        self._train = train
        self.epoch, self.connected = 0, False
        self.since = self.seen = self.left = self.final_until = HostNs(0)
        self.first: HostNs | None = None
        self._readings = 0  # of the camera's clock in this epoch

    def begin(self, epoch: int, host: HostNs) -> None:
        """Begin an epoch at host time `host`."""
        self.epoch, self.connected = epoch, True
        self.since = self.seen = host
        self.first, self._readings = None, 0

    def end(self, host: HostNs, seen: HostNs) -> None:
        """End the epoch at host time `host`; the camera was there until `seen`."""
        self.final_until = max(self.final_until, host)
        self.left = max(self.left, seen)
        self.connected = False

    def answered(self, until: HostNs) -> None:
        """Enter a reading of the camera's clock: frames that were triggered before `until` would have come."""
        self._readings += 1
        self.seen = max(self.seen, until)

    def delivered(self, time: HostNs) -> None:
        """Enter a whole frame, triggered at `time`."""
        self.first = self.first or time
        self.final_until = time
        self.seen = max(self.seen, time)

    def may_deliver(self, time: HostNs) -> bool:
        """Whether a whole frame of a pulse at `time` may still come."""
        return self.connected and time >= self.final_until and time >= self.since - self._train.tolerance_ns

    def was_there(self, time: HostNs) -> bool:
        """Whether the camera was connected and set up at `time`, and has been since."""
        return self.connected and time >= (self.since + FIRST_NS if self.first is None else self.since)

    def is_awaited(self, time: HostNs) -> bool:
        """Whether the camera was there before `time`, has answered in this epoch, but not since `time`."""
        return self.was_there(time) and self._readings > 1 and time > self.seen

    def was_away(self, time: HostNs) -> bool:
        """Whether the camera was disconnected at `time`, or not set up yet."""
        if time <= self.left or not self.connected:
            return time > self.left
        return time < (self.since + FIRST_NS if self.first is None else self.first - self._train.tolerance_ns)

    def was_there_before(self, time: HostNs | None) -> bool:
        """Whether the camera delivered its first frame by `time`; False for None."""
        return self.first is not None and time is not None and self.first <= time
