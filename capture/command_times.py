"""The time base of a camera that is told to expose, and whose own clock cannot be read: when it was told.

A frame that comes does not say which command has made it. So only one command is under way at a time: the next one is
given when the frame of the last has come, whole or not, or when it surely never will.
"""

from typing import Final

from rig.clocks import NS_PER_S, ClockLatch, DeviceNs, HostNs

#: After exposure a frame is on its way for less than this.
_ON_ITS_WAY_NS: Final = NS_PER_S
#: From so many frames it is told how late the camera may expose.
_FRAMES: Final = 8


class CommandTimes:
    """Tells the time of each frame of one connection on the host's own clock.

    Args:
        exposure_ns: exposure time.
        longest_ns: a command that was longer on its way, or whose answer was, has no usable time.
    """

    def __init__(self, exposure_ns: int, longest_ns: int) -> None:
        self._given_up_ns, self._exposure_ns, self._longest_ns = exposure_ns + _ON_ITS_WAY_NS, exposure_ns, longest_ns
        self._sent: tuple[HostNs, HostNs] | None = None
        self._round_trip_ns = longest_ns
        self._frames = 0
        self._latest_ns = 0

    def is_free(self, now: HostNs) -> bool:
        """Whether no command is under way."""
        return self._sent is None or now > self._sent[1] + self._given_up_ns

    def sent(self, before: HostNs, after: HostNs) -> None:
        """Note a command that was sent and answered between two times."""
        self._sent = before, after
        self._round_trip_ns = after - before

    def answered(self, arrival: HostNs) -> DeviceNs | None:
        """Note that a frame has come, whole or not.

        Returns:
            Its time; None: no command has made it, or its time is not known well enough.
        """
        if self._sent is None:
            return None
        (before, after), self._sent = self._sent, None
        if after - before > self._longest_ns:
            return None
        self._frames += 1
        if self._frames <= _FRAMES:
            self._latest_ns = max(self._latest_ns, arrival - before - self._exposure_ns)
        return DeviceNs((before + after) // 2)

    def notice(self) -> str | None:
        """What it costs that the clock cannot be read, once, as soon as it is measured."""
        if self._frames != _FRAMES:
            return None
        self._frames += 1
        return (
            "its clock cannot be read: its frames have the times of the commands, and were exposed up to "
            f"{max(0, self._latest_ns) / 1e6:.1f} ms later"
        )

    def latch(self, now: HostNs) -> ClockLatch:
        """The host's clock against itself, as uncertain as the moment of the last command."""
        return ClockLatch(DeviceNs(now), now, self._round_trip_ns)
