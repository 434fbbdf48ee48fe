"""A simulated camera's own clock: offset and drift against the host's, and the jitter of its exposures.

Pure functions of the scenario, so that every process and every back end sees the same clock.
"""

import random

from rig.clocks import NS_PER_S, NS_PER_US, DeviceNs, HostNs
from simrig.world.scenario import Scenario

#: Device clocks count from power-up; an hour before the hill began keeps them positive with any sensible offset.
_UP_BEFORE_NS = 3600 * NS_PER_S


class DeviceClock:
    """Clock of one camera of a scenario.

    Args:
        scenario: the scenario.
        camera: index of the camera in it.
        epoch: host time of hill pulse 0, at which the camera's offset holds exactly.
    """

    def __init__(self, scenario: Scenario, camera: int, epoch: HostNs) -> None:
        settings = scenario.cameras[camera]
        self._epoch = epoch
        self._start = _UP_BEFORE_NS + round(settings.offset_s * NS_PER_S)
        self._rate_ppb = round(settings.drift_ppm * 1000)
        self._jitter_ns = settings.exposure_jitter_us * NS_PER_US
        self._seed = f"{scenario.seed}/{camera}"

    def at(self, host: HostNs) -> DeviceNs:
        """What the clock shows at a host time."""
        elapsed = host - self._epoch
        return DeviceNs(self._start + elapsed + elapsed * self._rate_ppb // NS_PER_S)

    def at_pulse(self, host: HostNs, pulse: int) -> DeviceNs:
        """Timestamp of the exposure that hill pulse `pulse` at `host` starts: the same at every call."""
        jitter = random.Random(f"{self._seed}/{pulse}").gauss(0.0, self._jitter_ns)  # noqa: S311  (no secret)
        return DeviceNs(self.at(host) + round(jitter))
