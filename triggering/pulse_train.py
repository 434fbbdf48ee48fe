"""The rhythm of the pulses: period tracked from the data, and the spread of the trigger times inside sets."""

from collections import deque
from typing import Final

from rig.clocks import HostNs

_RECENT: Final = 256
#: Neighbours in the train are at most this share off the period; anything else is a gap, a pause or a disturbance.
_NEIGHBOUR: Final = 0.3
_PERIOD_GAIN: Final = 0.02
#: Spread beyond this share of the period: frames are about to be taken for another pulse's.
_ALARM: Final = 0.25


class PulseTrain:
    """What the decided pulses tell about the train.

    Attributes:
        period_ns: present estimate of the period; begins at the nominal one.
        last: time of the last decided pulse.
    """

    def __init__(self, period_ns: int) -> None:
        self.period_ns = float(period_ns)
        self.last: HostNs | None = None
        self._spreads: deque[int] = deque(maxlen=_RECENT)

    def room(self, span_ns: int) -> int:
        """How many pulses of an unbroken train lie between two that are `span_ns` apart."""
        return max(0, round(span_ns / self.period_ns) - 1)

    def advance(self, time: HostNs, spread_ns: int) -> None:
        """The next pulse is decided.

        Args:
            time: its time.
            spread_ns: latest minus earliest trigger time of its frames, 0 if that cannot be told.
        """
        if self.last is not None:
            interval = time - self.last
            deviation = interval - self.period_ns
            if abs(deviation) < _NEIGHBOUR * self.period_ns:
                self.period_ns += _PERIOD_GAIN * deviation
            elif deviation < 0:
                # Too soon for a new pulse: one whose frames no longer find each other. It counts as spread.
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
        """The recent sets spread over more than a quarter of the period: clocks or trigger are not to be trusted."""
        return self.spread_max_ns > _ALARM * self.period_ns
