"""How fast pulses arrive, from the recorder's count of them once a second."""

from typing import Final

#: Without a report for so long nothing is known any more.
_STALE_S: Final = 3.0


class PulseRate:
    """Fed with counts and the times at which they were reported.

    Attributes:
        arriving: whether pulses came between the last two reports, or before the first.
    """

    def __init__(self) -> None:
        self._count = 0
        self._at: float | None = None
        self._rate: float | None = None
        self.arriving = False

    def count(self, pulses: int, now: float) -> None:
        """Enter a report.

        Args:
            pulses: pulses so far.
            now: on the monotonic clock, s.
        """
        if self._at is not None and now > self._at and pulses >= self._count:
            seconds = now - self._at
            self._rate = (pulses - self._count) / seconds if seconds < _STALE_S else None
        self.arriving = pulses > self._count
        self._count, self._at = pulses, now

    def forget(self) -> None:
        """Nothing runs any more."""
        self._at = self._rate = None
        self._count = 0
        self.arriving = False

    @property
    def rate_hz(self) -> float | None:
        """Pulses per second, None if that is not known."""
        return self._rate
