"""One type per clock, so that a time of one clock is never compared with a time of another.

- `DeviceNs`: a camera's own clock, ns since whatever it counts from.
- `HostNs`: `CLOCK_MONOTONIC` of this machine, ns. The common time line of all cameras is expressed in it.
- `UtcNs`: ns since 1970-01-01 UTC. Only for people, files and messages; never subtracted to get durations,
  because it may be stepped by NTP.
"""

import time
from dataclasses import dataclass
from typing import NewType

DeviceNs = NewType("DeviceNs", int)
HostNs = NewType("HostNs", int)
UtcNs = NewType("UtcNs", int)

NS_PER_S = 1_000_000_000
NS_PER_US = 1_000


def host_now() -> HostNs:
    """Time of the host's monotonic clock, ns."""
    return HostNs(time.monotonic_ns())


@dataclass(frozen=True, slots=True)
class UtcAnchor:
    """The relation host clock -> UTC, taken once per recording so that times inside one never jump.

    Attributes:
        offset_ns: UTC minus host time, ns.
    """

    offset_ns: int

    @classmethod
    def take(cls, tries: int = 5) -> "UtcAnchor":
        """Read both clocks `tries` times and keep the pair with the shortest gap between the readings."""
        best_gap, best_offset = None, 0
        for _ in range(tries):
            before = time.monotonic_ns()
            utc = time.time_ns()
            after = time.monotonic_ns()
            if best_gap is None or after - before < best_gap:
                best_gap, best_offset = after - before, utc - (before + after) // 2
        return cls(best_offset)

    def utc(self, host: HostNs) -> UtcNs:
        """UTC of a host time."""
        return UtcNs(host + self.offset_ns)

    def host(self, utc: UtcNs) -> HostNs:
        """Host time of a UTC time of this recording."""
        return HostNs(utc - self.offset_ns)


@dataclass(frozen=True, slots=True)
class ClockLatch:
    """One simultaneous reading of a camera's clock and the host's.

    Attributes:
        device: device clock at the latch, ns.
        host: middle of the round trip on the host clock, ns.
        round_trip_ns: duration of the round trip; the host time is uncertain by half of it.
    """

    device: DeviceNs
    host: HostNs
    round_trip_ns: int
