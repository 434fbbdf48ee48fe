"""When the hill's trigger pulses fire, and what each camera's own clock shows then.

Both are pure functions of the host's monotonic clock, which is the same in every process of a machine. So simulators in
separate processes agree on every pulse without a wire between them: they only share `epoch`, rate and scenario.
"""

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rig.clocks import NS_PER_S, NS_PER_US, DeviceNs, HostNs
from rig.errors import BadInputError
from rig.pulse import HillPulse
from simrig.world.scenario import Scenario

#: The trigger line stays high for so long at each pulse.
PULSE_WIDTH_NS: Final = 500_000
#: A device clock counts from its power-up. One hour before hill pulse 0 keeps it positive with any sensible offset.
_UP_BEFORE_NS: Final = 3600 * NS_PER_S


@dataclass(frozen=True, slots=True)
class PulseTrain:
    """The trigger pulses: hill pulse n, counted from 0, is due at `epoch + round(n / rate_hz)`.

    Attributes:
        epoch: host time of pulse 0.
        rate_hz: pulses per second.
        pauses: half-open ranges [from, to) of pulses that are not fired; the other pulses keep their numbers.

    Raises:
        BadInputError: the rate is not positive or a pause is empty.
    """

    epoch: HostNs
    rate_hz: float
    pauses: Sequence[tuple[int, int]] = ()

    def __post_init__(self) -> None:
        """Check the fields and sort the pauses."""
        if not (math.isfinite(self.rate_hz) and self.rate_hz > 0):
            raise BadInputError(f"pulse rate {self.rate_hz} Hz: give a rate above 0")
        for first, end in self.pauses:
            if not 0 <= first < end:
                raise BadInputError(f"pause [{first}, {end}): give a first pulse of at least 0 and a later end")
        object.__setattr__(self, "pauses", tuple(sorted((int(first), int(end)) for first, end in self.pauses)))

    def time(self, n: HillPulse) -> HostNs:
        """When pulse `n` is due."""
        return HostNs(self.epoch + round(n * NS_PER_S / self.rate_hz))

    def nearest(self, host: HostNs) -> HillPulse | None:
        """The pulse that is due nearest to a time; None if that one is not fired."""
        n = HillPulse(max(0, round((host - self.epoch) * self.rate_hz / NS_PER_S)))
        return None if any(first <= n < end for first, end in self.pauses) else n

    def fired_at(self, host: HostNs) -> HillPulse | None:
        """The pulse that was fired at a measured time; None if none was within a quarter of a period."""
        n = self.nearest(host)
        return None if n is None or 4 * abs(host - self.time(n)) > NS_PER_S / self.rate_hz else n

    def next_index(self, after: HostNs) -> HillPulse:
        """Index of the first pulse that is fired strictly later than `after`."""
        n = max(0, math.floor((after - self.epoch) * self.rate_hz / NS_PER_S))
        while n > 0 and self.time(HillPulse(n - 1)) > after:  # rounding may be off by one either way
            n -= 1
        while self.time(HillPulse(n)) <= after:
            n += 1
        for first, end in self.pauses:
            if first <= n < end:
                n = end
        return HillPulse(n)


class DeviceClock:
    """The clock of one camera of a scenario: offset and drift against the host's clock, jitter of the exposures.

    Args:
        scenario: the scenario.
        camera: index of the camera in it.
        epoch: host time of hill pulse 0, at which the clock's offset is exactly the scenario's.
    """

    def __init__(self, scenario: Scenario, camera: int, epoch: HostNs) -> None:
        settings = scenario.cameras[camera]
        self._epoch = epoch
        self._start = _UP_BEFORE_NS + round(settings.offset_s * NS_PER_S)
        self._rate_ppb = round(settings.drift_ppm * 1000)
        self._jitter_ns = settings.exposure_jitter_us * NS_PER_US
        self._seed = f"{scenario.seed}/{camera}"

    def at(self, host: HostNs) -> DeviceNs:
        """Reading of the clock at a host time."""
        elapsed = host - self._epoch
        return DeviceNs(self._start + elapsed + elapsed * self._rate_ppb // NS_PER_S)

    def at_pulse(self, host: HostNs, pulse: HillPulse) -> DeviceNs:
        """Timestamp of the exposure that hill pulse `pulse` starts at `host`; every call gives the same jitter."""
        jitter = random.Random(f"{self._seed}/{pulse}").gauss(0.0, self._jitter_ns)  # noqa: S311  (no secret)
        return DeviceNs(self.at(host) + round(jitter))
