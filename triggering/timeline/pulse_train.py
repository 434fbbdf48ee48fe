"""Tracks the period of the pulses, and how far the trigger times of the frames of one pulse lie apart."""

from collections import deque
from statistics import median_low
from typing import Final

from rig.clocks import HostNs

_RECENT: Final = 256
#: The interval of two neighbouring pulses differs from the period by less than this share; other intervals are gaps,
#: pauses or disturbances.
_NEIGHBOUR: Final = 0.3
_PERIOD_GAIN: Final = 0.02
#: The rhythm is known if, of so many intervals, at least half agree with their median to this share of it.
_RHYTHM: Final = 64
_RHYTHM_LEAST: Final = 4
_AGREE: Final = 0.05
#: With a larger spread, as a share of the period, frames may soon be paired with the wrong pulse.
_ALARM: Final = 0.25


class PulseTrain:
    """Period and spreads, estimated from the decided pulses.

    Attributes:
        period_ns: present estimate of the period; begins with the nominal one.
        last: time of the last decided pulse.
    """

    def __init__(self, period_ns: int) -> None:
        self.period_ns = float(period_ns)
        self.last: HostNs | None = None
        self._spreads: deque[int] = deque(maxlen=_RECENT)
        self._intervals: deque[int] = deque(maxlen=_RHYTHM)

    @property
    def rhythm_ns(self) -> float | None:
        """The period by which an unbroken train goes on, ns; None if the pulses so far do not tell one.

        The mean of the recent intervals is nearer to it than `period_ns`, which follows slowly.
        """
        if len(self._intervals) < _RHYTHM_LEAST:
            return None
        usual = median_low(self._intervals)
        agreeing = [interval for interval in self._intervals if abs(interval - usual) < _AGREE * usual]
        return sum(agreeing) / len(agreeing) if 2 * len(agreeing) >= len(self._intervals) else None

    def go_on(self, time: HostNs) -> None:
        """Enter a pulse that no camera could see; its time follows from the rhythm, so it tells nothing of it."""
        self.last = time

    def room(self, span_ns: int) -> int:
        """How many pulses of an unbroken train lie between two that are `span_ns` apart."""
        return max(0, round(span_ns / self.period_ns) - 1)

    def advance(self, time: HostNs, spread_ns: int) -> None:
        """Enter the next decided pulse.

        Args:
            time: time of the pulse.
            spread_ns: latest minus earliest trigger time of its frames, 0 if there are fewer than two.
        """
        if self.last is not None:
            interval = time - self.last
            self._intervals.append(interval)
            deviation = interval - self.period_ns
            if abs(deviation) < _NEIGHBOUR * self.period_ns:
                self.period_ns += _PERIOD_GAIN * deviation
            elif deviation < 0:
                # Too soon for another pulse: the frames of one pulse were taken for two. The interval counts as spread.
                spread_ns = max(spread_ns, interval)
        self.last = time
        if spread_ns > 0:
            self._spreads.append(spread_ns)

    @property
    def spread_median_ns(self) -> int:
        """Median spread inside the recent sets."""
        return sorted(self._spreads)[len(self._spreads) // 2] if self._spreads else 0

    @property
    def spread_max_ns(self) -> int:
        """Largest spread inside the recent sets."""
        return max(self._spreads, default=0)

    @property
    def alarm(self) -> bool:
        """Whether recent spreads exceed a quarter of the period: then clocks or trigger are wrong."""
        return self.spread_max_ns > _ALARM * self.period_ns
