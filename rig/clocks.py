"""Times of different clocks as different types, so that a time of one clock is never compared with one of another.

- `DeviceNs`: a camera's own clock, ns since an instant that only the camera knows.
- `HostNs`: `CLOCK_MONOTONIC` of this machine, ns: the common time line, on which the times of all cameras are put.
- `UtcNs`: ns since 1970-01-01 UTC. Only for people, files and messages. Durations are never differences of UTC times,
  because NTP may step that clock.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NewType


class DecimalNs(int):
    """Nanoseconds that are a string of decimal digits in JSON, because JavaScript would round a number."""

    __slots__ = ()


class DeviceNs(DecimalNs):
    """Time of a camera's own clock, ns since an instant that only the camera knows."""

    __slots__ = ()


class UtcNs(DecimalNs):
    """UTC, ns since 1970-01-01."""

    __slots__ = ()


#: Time of this machine's `CLOCK_MONOTONIC`, ns.
HostNs = NewType("HostNs", int)

NS_PER_S = 1_000_000_000
NS_PER_US = 1_000


def host_now() -> HostNs:
    """Time of the host's monotonic clock, ns."""
    return HostNs(time.monotonic_ns())


def sleep_until(host: HostNs) -> None:
    """Wait until a host time, which may be past already."""
    if (remaining := host - host_now()) > 0:
        time.sleep(remaining / NS_PER_S)


@dataclass(frozen=True, slots=True)
class UtcAnchor:
    """The relation of host clock to UTC, taken once per recording, so that UTC times within a recording never jump.

    Attributes:
        offset_ns: UTC minus host time, ns.
    """

    offset_ns: int

    @classmethod
    def take(cls, tries: int = 5) -> "UtcAnchor":
        """Read both clocks `tries` times and use the reading that took the shortest time."""
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
        """Host time of a UTC time that `utc` gave."""
        return HostNs(utc - self.offset_ns)


@dataclass(frozen=True, slots=True)
class ClockLatch:
    """One simultaneous reading of a camera's clock and the host's.

    Attributes:
        device: time of the camera's clock, ns.
        host: host time half-way between asking the camera and its answer, ns.
        round_trip_ns: time from asking to the answer; `host` is uncertain by half of it.
    """

    device: DeviceNs
    host: HostNs
    round_trip_ns: int

    @classmethod
    def computed(cls, device_at: Callable[[HostNs], DeviceNs]) -> "ClockLatch":
        """Read a device clock that is computed from the host's."""
        now = host_now()
        return cls(device_at(now), now, host_now() - now)
