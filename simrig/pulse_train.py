"""The trigger pulses of the simulated hill, on the host's monotonic clock.

That clock is the same in every process of a machine, so camera simulators in separate processes agree on every pulse
without a wire between them: they only have to share `epoch`, rate and pauses.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rig.clocks import NS_PER_S, HostNs
from rig.errors import BadInputError

#: The trigger line falls so much later than it rises at a pulse.
PULSE_WIDTH_NS: Final = 500_000


@dataclass(frozen=True, slots=True)
class PulseTrain:
    """Hill pulse n, counted from 0, is due at `epoch + round(n / rate_hz)`.

    Attributes:
        epoch: time of pulse 0.
        rate_hz: pulses per second.
        pauses: half-open ranges [from, to) of pulse indices that are not fired; the pulses keep their numbers.

    Raises:
        BadInputError: the rate is not positive or a pause is empty.
    """

    epoch: HostNs
    rate_hz: float
    pauses: Sequence[tuple[int, int]] = ()

    def __post_init__(self) -> None:
        """Check the fields and bring the pauses into order."""
        if not (math.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise BadInputError(f"pulse rate {self.rate_hz} Hz: give a rate above 0")
        for first, end in self.pauses:
            if not 0 <= first < end:
                raise BadInputError(f"pause [{first}, {end}): give a first pulse of at least 0 and a later end")
        object.__setattr__(self, "pauses", tuple(sorted((int(first), int(end)) for first, end in self.pauses)))

    def time(self, n: int) -> HostNs:
        """When pulse `n` is due."""
        return HostNs(self.epoch + round(n * NS_PER_S / self.rate_hz))

    def fires(self, n: int) -> bool:
        """Whether pulse `n` exists: not negative and in no pause."""
        return n >= 0 and not any(first <= n < end for first, end in self.pauses)

    def next_index(self, after: HostNs) -> int:
        """Index of the first pulse that is fired strictly later than `after`."""
        n = max(0, math.floor((after - self.epoch) * self.rate_hz / NS_PER_S))
        while n > 0 and self.time(n - 1) > after:  # rounding may be off by one either way
            n -= 1
        while self.time(n) <= after:
            n += 1
        for first, end in self.pauses:
            if first <= n < end:
                n = end
        return n
