"""Timer 1 of a trigger box, as its firmware sets it up: one with a crystal of its own, or one in step with the hill."""

import math
from typing import Final, Protocol

from rig.clocks import NS_PER_S, HostNs
from simrig.world.pulses import PulseTrain

_CLOCK_HZ: Final = 16_000_000
#: The output falls, and the pulse is counted, so many ticks after its edge rose.
_WIDTH_TICKS: Final = 1000
_FIRST_ICR1: Final = 10_000


class Timer(Protocol):
    """What the firmware does to the timer, and what it reads of it."""

    def begin_anew(self, now: HostNs) -> None:
        """Lose everything, as after a loss of power; the pulses stand still."""
        ...

    def reset(self, now: HostNs) -> None:
        """Stop the pulses, and count from 0."""
        ...

    def start(self, now: HostNs) -> None:
        """Go on."""
        ...

    def stop(self, now: HostNs) -> None:
        """Stand still."""
        ...

    def set_rate(self, icr1: int, prescaler: int, now: HostNs) -> None:
        """Count to `icr1`, at 16 MHz / prescaler."""
        ...

    def read(self, now: HostNs) -> tuple[int, int]:
        """Number of pulses counted, and ticks."""
        ...


class CrystalTimer:
    """A timer whose crystal is off; see `Timer`.

    Args:
        ppm: how much faster than the host's clock it runs.
    """

    def __init__(self, ppm: float = 0.0) -> None:
        self._hz = _CLOCK_HZ * (1 + ppm * 1e-6)
        self.begin_anew(HostNs(0))

    def begin_anew(self, now: HostNs) -> None:
        """See `Timer.begin_anew`."""
        self._icr1, self._prescaler, self._runs = _FIRST_ICR1, 64, False
        self._counted = 0, 0.0, now  # pulses, ticks, when; one object, since other threads read it

    def reset(self, now: HostNs) -> None:
        """See `Timer.reset`."""
        self.stop(now)
        self._counted = 0, *self._counted[1:]

    def start(self, now: HostNs) -> None:
        """See `Timer.start`."""
        self._go_on(now)
        self._runs = True

    def stop(self, now: HostNs) -> None:
        """See `Timer.stop`."""
        self._go_on(now)
        self._runs = False

    def set_rate(self, icr1: int, prescaler: int, now: HostNs) -> None:
        """See `Timer.set_rate`."""
        self._go_on(now)
        self._icr1, self._prescaler = icr1, prescaler
        count, ticks, at = self._counted
        self._counted = count, min(ticks, float(icr1)), at

    def read(self, now: HostNs) -> tuple[int, int]:
        """See `Timer.read`."""
        self._go_on(now)
        return self._counted[0], int(self._counted[1])

    @property
    def runs(self) -> bool:
        """Whether pulses are made."""
        return self._runs

    @property
    def period_ns(self) -> float:
        """Time between two pulses, ns."""
        return (self._icr1 + 1) * self._prescaler / self._hz * NS_PER_S

    def rose_at(self, number: int) -> float:
        """Host time at which the edge of a pulse rose or will rise, ns, as the timer runs at present."""
        period = self._icr1 + 1
        count, ticks, at = self._counted
        last = count + (ticks < _WIDTH_TICKS)
        return at + ((number - last) * period - ticks) * self._prescaler / self._hz * NS_PER_S

    def _go_on(self, now: HostNs) -> None:
        count, before, at = self._counted
        ticks = before
        if self._runs:
            ticks = before + (now - at) / NS_PER_S * self._hz / self._prescaler
            period = self._icr1 + 1
            count += math.floor((ticks - _WIDTH_TICKS) / period) - math.floor((before - _WIDTH_TICKS) / period)
            ticks %= period
        self._counted = count, ticks, now


class HillTimer:
    """A timer that makes the pulses of the simulated hill, whatever rate it is set to; see `Timer`.

    The simulated cameras know when the hill's pulses fire, and see them while the timer stands still, too. A pause of
    the scenario is one of the cable: the timer goes on, and no camera sees the pulses.

    Args:
        train: the pulses.
    """

    def __init__(self, train: PulseTrain) -> None:
        self._train, self._icr1 = train, _FIRST_ICR1
        self._first: int | None = None
        self._frozen = 0, 0

    def begin_anew(self, now: HostNs) -> None:
        """See `Timer.begin_anew`."""
        self.reset(now)

    def reset(self, now: HostNs) -> None:
        """See `Timer.reset`."""
        del now
        self._first, self._frozen = None, (0, self._icr1)

    def start(self, now: HostNs) -> None:
        """See `Timer.start`."""
        if self._first is None:
            self._first = self._periods(now)[0] + 1 - self._frozen[0]

    def stop(self, now: HostNs) -> None:
        """See `Timer.stop`."""
        self._frozen, self._first = self.read(now), None

    def set_rate(self, icr1: int, prescaler: int, now: HostNs) -> None:
        """See `Timer.set_rate`."""
        del prescaler, now
        self._icr1 = icr1

    def read(self, now: HostNs) -> tuple[int, int]:
        """See `Timer.read`."""
        if self._first is None:
            return self._frozen
        pulse, share = self._periods(now)
        ticks = int(share * (self._icr1 + 1))
        fired = pulse - self._first + 1
        if ticks >= _WIDTH_TICKS:
            return fired, ticks
        # The pulse before the first one is none of ours, and has no falling edge that could be counted.
        return (0, _WIDTH_TICKS) if fired == 0 else (fired - 1, ticks)

    def _periods(self, now: HostNs) -> tuple[int, float]:
        """The last pulse, and the share of the period that has gone since."""
        periods = (now - self._train.epoch) * self._train.rate_hz / NS_PER_S
        return math.floor(periods), periods % 1
