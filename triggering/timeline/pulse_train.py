"""Learns the rhythm of the pulses, and how far the trigger times of the frames of one pulse lie apart.

The rate of the rig file only serves until enough pulses have been measured.
"""

from collections import deque
from math import ceil
from statistics import median_low
from typing import Final

from rig.clocks import HostNs
from triggering.timeline.steady_rate import AGREE

_RECENT: Final = 256
_PERIOD_GAIN: Final = 0.02
#: The rhythm is known if, of so many intervals, at least half agree with their median to `AGREE`.
RHYTHM: Final = 64
RHYTHM_LEAST: Final = 4
#: A rhythm is measured, or has changed, if so many intervals in a row agree with one another.
_CHANGE: Final = 4
#: Two pulses that are closer than this share of the period, and that no camera saw both of, may have been one.
_SPLIT: Final = 0.7
#: With a larger spread, as a share of the period, frames may soon be paired with the wrong pulse.
_ALARM: Final = 0.25
#: Frames whose times differ by more than this share of the period are never of one pulse.
_WIDEST: Final = 0.3
#: Clocks that are read four times a second agree to this, ns: half a round trip, drift in between, and the same again
#: by which frames may have trimmed them.
CLOCKS_NS: Final = 500_000
#: Spread of the trigger that is allowed for until it is known, ns.
_SPREAD_NS: Final = 2_500_000
#: Afterwards: so many times the spread that this share of the pulses keeps. The spread of trigger times that are even
#: over an interval has its 90 % point at 0.8 of it for three cameras, at 0.68 for two; the rest is for few pulses.
_SHARE_KEPT: Final = 0.9
_SPREADS: Final = 3.0
#: The spread is learned from so many pulses, and anew after as many.
_LEARN_EVERY: Final = 24


class Rhythm:
    """The period of the pulses, measured from the intervals between them.

    Args:
        period_ns: nominal period, until one is measured.

    Attributes:
        period_ns: present estimate of the period.
        steady: the period is measured, and the last pulses came in it.
    """

    def __init__(self, period_ns: int) -> None:
        self.period_ns, self._nominal_ns = float(period_ns), period_ns
        self.steady = False
        self._intervals: deque[int] = deque(maxlen=RHYTHM)
        self._usual: tuple[float | None] | None = None  # computed from the intervals; None: they have changed since

    @property
    def usual_ns(self) -> float | None:
        """The period by which an unbroken train goes on, ns; None if the pulses so far do not tell one.

        The mean of the recent intervals is nearer to it than `period_ns`, which follows slowly.
        """
        if self._usual is None:
            self._usual = (self._usual_interval(),)
        return self._usual[0]

    @property
    def shortest_ns(self) -> float:
        """The shortest time between two of the recent pulses; the period if there are none."""
        return min(self._intervals, default=self.period_ns)

    def add(self, interval: int) -> bool:
        """Follow the rhythm slowly while it goes on, and take the new one where it has changed.

        Args:
            interval: the next interval between two pulses, ns.

        Returns:
            Whether the period was measured anew.
        """
        self._intervals.append(interval)
        self._usual = None
        deviation = interval - self.period_ns
        if self.steady and abs(deviation) < AGREE * self.period_ns:
            self.period_ns += _PERIOD_GAIN * deviation
            return False
        recent = list(self._intervals)[-_CHANGE:]
        if len(recent) == _CHANGE and max(recent) - min(recent) < AGREE * min(recent):
            if abs(min(recent) - self.period_ns) > AGREE * self.period_ns:
                self._intervals = deque(recent, maxlen=RHYTHM)  # those before are of another rhythm
            self.period_ns, self.steady = sum(recent) / _CHANGE, True
            return True
        if self.steady and self.usual_ns is None:
            self.steady, self.period_ns = False, float(self._nominal_ns)
        return False

    def _usual_interval(self) -> float | None:
        if len(self._intervals) < RHYTHM_LEAST:
            return None
        usual = median_low(self._intervals)
        reach = ceil(AGREE * usual) - 1  # intervals are whole ns: they agree if they differ by less than the share
        least, most = usual - reach, usual + reach
        agreeing = [interval for interval in self._intervals if least <= interval <= most]
        return sum(agreeing) / len(agreeing) if 2 * len(agreeing) >= len(self._intervals) else None


class PulseTrain:
    """Period and spreads, measured from the decided pulses.

    Args:
        period_ns: nominal period, until one is measured.
        widest_ns: frames further apart are never of one pulse, whatever is learned; None: a share of the period.
        spread_ns: how far apart the trigger itself may expose the cameras, which is allowed for at any time.

    Attributes:
        rhythm: the period.
        tolerance_ns: frames whose trigger times are this close are of one pulse.
        widest_ns: frames whose trigger times differ by more are never of one pulse.
        last: time of the last decided pulse.
        split: time of the last pulse that may have been one with that before it, and its distance; None: there is none.
    """

    def __init__(self, period_ns: int, widest_ns: int | None = None, spread_ns: int = 0) -> None:
        self.rhythm = Rhythm(period_ns)
        self.last: HostNs | None = None
        self.split: tuple[HostNs, int] | None = None
        self._limit_ns = self.widest_ns = _WIDEST * period_ns if widest_ns is None else float(widest_ns)
        self._least_ns = CLOCKS_NS + spread_ns
        self.tolerance_ns = min(max(_SPREAD_NS, self._least_ns), self.widest_ns)
        self._spreads: deque[int] = deque(maxlen=_RECENT)
        self._delivered = 0
        self._beat: HostNs | None = None  # the last pulse that was not the second half of one
        self._learn_in = _LEARN_EVERY

    @property
    def period_ns(self) -> float:
        """Present estimate of the period."""
        return self.rhythm.period_ns

    def is_decided(self, time: HostNs) -> bool:
        """Whether a trigger time is of the last decided pulse, or of an earlier one."""
        return self.last is not None and time <= self.last + self.tolerance_ns

    def go_on(self, time: HostNs) -> None:
        """Enter a pulse that no camera could see; its time follows from the rhythm, which it does not change."""
        self.last, self._beat, self._delivered = time, time, 0

    def room(self, span_ns: int) -> int:
        """How many pulses of an unbroken train lie between two that are `span_ns` apart."""
        return max(0, round(span_ns / self.period_ns) - 1)

    def advance(self, time: HostNs, spread_ns: int, delivered: int) -> None:
        """Enter the next decided pulse.

        Args:
            time: time of the pulse.
            spread_ns: latest minus earliest trigger time of its frames, 0 if there are fewer than two.
            delivered: the cameras of which it has a frame, one bit each; 0: none.
        """
        last, self.last = self.last, time
        if last is not None:
            interval = time - last
            if self._is_split(interval, delivered):
                # The frames of one pulse were taken for two, or there were two for one: the interval counts as spread.
                spread_ns = max(spread_ns, interval)
                self.split = time, interval
            else:
                interval = time - (self._beat or last)
                if self.rhythm.add(interval):
                    self.widest_ns = min(self._limit_ns, _WIDEST * self.period_ns)
                    self.tolerance_ns = min(self.tolerance_ns, self.widest_ns)
                self._beat = time
        self._delivered = delivered
        if spread_ns > 0:
            self._spreads.append(spread_ns)
            self._learn_in -= 1
            if self._learn_in <= 0:
                self._learn_in = _LEARN_EVERY
                self._learn_tolerance()

    def _is_split(self, interval: int, delivered: int) -> bool:
        """Whether this pulse and the last one may have been one: close together, and no camera saw both."""
        apart = delivered & self._delivered == 0 and delivered != 0 and self._delivered != 0
        return apart and interval < _SPLIT * self.period_ns

    def _learn_tolerance(self) -> None:
        self.tolerance_ns = min(max(self._least_ns, _SPREADS * self.spread_usual_ns), self.widest_ns)

    @property
    def spread_median_ns(self) -> int:
        """Median spread inside the recent sets."""
        return sorted(self._spreads)[len(self._spreads) // 2] if self._spreads else 0

    @property
    def spread_usual_ns(self) -> int:
        """The spread that nine in ten of the recent sets keep."""
        return sorted(self._spreads)[int(_SHARE_KEPT * (len(self._spreads) - 1))] if self._spreads else 0

    @property
    def spread_max_ns(self) -> int:
        """Largest spread inside the recent sets."""
        return max(self._spreads, default=0)

    @property
    def alarm(self) -> bool:
        """Whether recent spreads exceed a quarter of the period: then clocks or trigger are wrong."""
        return self.spread_max_ns > _ALARM * self.period_ns
