"""When one camera last sent something, and how late its frames come."""

from typing import Final

from rig.clocks import NS_PER_S, HostNs

#: Whole frames may be held back this long behind a damaged one.
HELD_BACK_NS: Final = NS_PER_S // 20
#: A camera whose frames come late is not silent before it has sent nothing for this long.
_SLOW_NS: Final = NS_PER_S
#: A camera is late if so many frames in a row came after the decision about their pulses.
_LATE_FRAMES: Final = 2


class Activity:
    """The signs of life of one camera.

    Attributes:
        silent: the camera is connected, but delivers nothing while others do, or while the source fires.
        unanswered: pulses decided without this camera since its last sign of life.
        alive: host time of the last sign of life: a trigger time or the connection.
        heard: host time at which the last whole frame came.
        lag_ns: how much later than usual the last whole frame came.
    """

    def __init__(self) -> None:
        self.silent = False
        self.unanswered = 0
        self.alive = self.heard = HostNs(0)
        self.lag_ns = 0.0
        self._late_frames = 0

    def begin(self, host: HostNs) -> None:
        """Begin an epoch at host time `host`."""
        self.silent, self.unanswered, self.alive = False, 0, host

    def stir(self) -> bool:
        """Enter an arrival of any kind.

        Returns:
            Whether the camera was silent until now.
        """
        was_silent, self.silent, self.unanswered = self.silent, False, 0
        return was_silent

    def frame(self, time: HostNs, arrival: HostNs, lag_ns: float, *, late: bool) -> None:
        """Enter a whole frame.

        Args:
            time: its trigger time.
            arrival: host time at which it came.
            lag_ns: how much later than usual it came.
            late: its pulse was decided already.
        """
        self.alive, self.heard, self.lag_ns, self.unanswered = time, arrival, lag_ns, 0
        self._late_frames = self._late_frames + 1 if late else 0

    def is_slow(self, now: HostNs) -> bool:
        """Whether the last frame came much later than usual, and not long ago: the link is slow, the camera works."""
        return self.lag_ns > HELD_BACK_NS and now < self.heard + _SLOW_NS

    @property
    def is_late(self) -> bool:
        """Whether several frames in a row came after the decision about their pulses."""
        return self._late_frames >= _LATE_FRAMES
