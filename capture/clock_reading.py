"""When a grabber reads its camera's clock: four times a second, and at once after a frame that comes out of turn.

A frame whose distance from the one before differs from the last distance may have the time of a clock that was set. The
pairing does not believe such a frame before the clock is read again, so it is read right after the frame.
"""

from typing import Final

from rig.clocks import NS_PER_S, DeviceNs, HostNs

_EVERY_NS: Final = NS_PER_S // 4
#: Frames that come so irregularly that each is out of turn cost no more readings than this.
_LEAST_NS: Final = NS_PER_S // 100
#: A distance is another one if it differs by so much; the pairing lets clocks differ by as much.
_OUT_OF_TURN_NS: Final = 500_000


class ClockReading:
    """Decides for one connection when the clock is read.

    Attributes:
        wanted: a frame came out of turn, and the clock has not been read since.
    """

    def __init__(self) -> None:
        self.wanted = False
        self._last_read = HostNs(0)
        self._last: DeviceNs | None = None
        self._distance: int | None = None

    def is_due(self, host: HostNs, device: DeviceNs | None = None) -> bool:
        """Whether the clock is to be read now.

        Args:
            host: present host time.
            device: trigger time of the whole frame that has just come; None: none has.
        """
        if device is not None:
            before, self._distance = self._distance, None if self._last is None else device - self._last
            self._last = device
            if before is None or self._distance is None or abs(self._distance - before) > _OUT_OF_TURN_NS:
                self.wanted = True
        return host >= (self.earliest if self.wanted else self._last_read + _EVERY_NS)

    @property
    def earliest(self) -> HostNs:
        """The host time from which on the clock may be read again."""
        return HostNs(self._last_read + _LEAST_NS)

    def done(self, host: HostNs) -> None:
        """Note that the clock was read at a host time."""
        self._last_read, self.wanted = host, False
