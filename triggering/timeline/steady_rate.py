"""The rate of a train of pulses, measured from the times of a few of them, and how far it can be wrong."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from rig.clocks import NS_PER_S, HostNs
from rig.health import PairingHealth

#: Intervals are of one train if they agree with the last one to this share of it.
AGREE: Final = 0.05
_INTERVALS_LEAST: Final = 2


@dataclass(frozen=True, slots=True)
class SteadyRate:
    """A rate.

    Attributes:
        hz: pulses per second.
        error: share by which it can be wrong.
    """

    hz: float
    error: float

    def contradicts(self, rate_hz: float, share: float) -> bool | None:
        """Whether the pulses come faster or slower than at a rate; None: they seem to, but it is not measured well.

        Cameras that are not ready for every pulse take only every second or third one, so a half or a third of the
        rate, and so on, may be that, and contradicts nothing.

        Args:
            rate_hz: the rate.
            share: of it, by which they may differ.
        """
        whole = max(1, round(rate_hz / self.hz))
        away = abs(self.hz * whole / rate_hz - 1)
        return None if share < away <= share + self.error else away > share


def steady_rate(times: Sequence[HostNs]) -> SteadyRate | None:
    """The rate of the last pulses.

    Intervals that agree to 5 % are of pulses that are seldom farther than 5 % of the period from an even train; so the
    first and the last of n intervals shift their mean by 2 * 5 % / n at most.

    Args:
        times: of pulses, in order.

    Returns:
        None: there are too few, or their distances differ.
    """
    intervals = [later - earlier for earlier, later in pairwise(times)]
    agreeing = 0
    for interval in reversed(intervals):
        if abs(interval - intervals[-1]) > AGREE * intervals[-1]:
            break
        agreeing += 1
    if agreeing < _INTERVALS_LEAST:
        return None
    span_ns = times[-1] - times[-1 - agreeing]
    return SteadyRate(NS_PER_S * agreeing / span_ns, _error(agreeing))


def rhythm(pairing: PairingHealth, least: int, most: int) -> SteadyRate | None:
    """The rate that the pairing has measured.

    Args:
        pairing: its health.
        least: it takes a rhythm from so many intervals at least.
        most: from so many of the last at most, at least half of which agree.

    Returns:
        None: the pulses have no rhythm.
    """
    if pairing.rate_hz is None:
        return None
    return SteadyRate(pairing.rate_hz, _error(max(least, min(most, pairing.pulses - 1) // 2)))


def _error(intervals: int) -> float:
    return 2 * AGREE / intervals
