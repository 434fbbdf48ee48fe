"""The clock that a FireWire camera's frames are stamped with, against the host's monotonic clock.

With a signature in its frames, a camera tells the cycle time of its bus: a clock that all devices on the bus share. It
is one word, 7 bits of seconds, 13 bits of cycles (8000 per second) and 12 bits of ticks (3072 per cycle, 24.576 MHz),
and wraps every 128 seconds. Without a signature there is only the time at which a frame's first packet came, which the
kernel tells in steps of one cycle: that clock *is* the host's.
"""

import time
from dataclasses import dataclass
from typing import Final, Protocol

from capture.iidc.device import Device
from rig.clocks import NS_PER_S, NS_PER_US, ClockLatch, DeviceNs, HostNs, host_now

CYCLE_NS: Final = 125_000
WRAP_NS: Final = 128 * NS_PER_S
_CYCLES, _TICKS = 8000, 3072
_READINGS: Final = 5


@dataclass(frozen=True, slots=True)
class CycleTime:
    """A reading of the cycle timer.

    Attributes:
        seconds: 0 to 127.
        cycles: 0 to 7999.
        ticks: 0 to 3071.
    """

    seconds: int
    cycles: int
    ticks: int

    @classmethod
    def from_word(cls, word: int) -> "CycleTime":
        """Read the register, or the first word of a signature."""
        return cls(word >> 25, word >> 12 & 0x1FFF, word & 0xFFF)

    @property
    def valid(self) -> bool:
        """Whether all fields are in range."""
        return self.cycles < _CYCLES and self.ticks < _TICKS

    @property
    def ns(self) -> int:
        """Nanoseconds since the last wrap, rounded."""
        ticks = (self.seconds * _CYCLES + self.cycles) * _TICKS + self.ticks
        return (ticks * 15625 + 192) // 384  # 1e9 / 24.576e6 = 15625 / 384


def unwrap(wrapped_ns: int, near_ns: int) -> int:
    """The time nearest to `near_ns` at which the clock shows `wrapped_ns`.

    Args:
        wrapped_ns: reading of the clock, 0 to `WRAP_NS`.
        near_ns: the time, known to 64 s.
    """
    half = WRAP_NS // 2
    return near_ns + (wrapped_ns - near_ns + half) % WRAP_NS - half


class BusClock(Protocol):
    """The clock in which the frames' trigger times are given."""

    def latch(self) -> ClockLatch:
        """Read it together with the host's clock.

        Raises:
            Dc1394Error: the card does not answer.
        """
        ...

    def at(self, host: HostNs) -> DeviceNs:
        """What the clock shows at a host time near the last latch."""
        ...


class CycleTimer:
    """The cycle timer of the bus, unwrapped.

    It starts at the value nearest to the host's clock, so that all grabbers on one bus agree.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        now = host_now()
        self._last = ClockLatch(DeviceNs(now), now, 0)
        self.latch()

    def latch(self) -> ClockLatch:
        """Read both clocks several times and keep the reading with the shortest round trip."""
        self._last = min((self._read() for _ in range(_READINGS)), key=lambda latch: latch.round_trip_ns)
        return self._last

    def at(self, host: HostNs) -> DeviceNs:
        """See `BusClock.at`."""
        return DeviceNs(self._last.device + host - self._last.host)

    def _read(self) -> ClockLatch:
        before = host_now()
        word = self._device.cycle_timer()
        after = host_now()
        middle = HostNs((before + after) // 2)
        return ClockLatch(DeviceNs(unwrap(CycleTime.from_word(word).ns, self.at(middle))), middle, after - before)


class PacketTimes:
    """For cameras without a signature: the host's clock, known to one cycle of the bus."""

    def latch(self) -> ClockLatch:
        """Both clocks are the same; the round trip stands for the frames' uncertainty of a cycle either way."""
        now = host_now()
        return ClockLatch(DeviceNs(now), now, 2 * CYCLE_NS)

    def at(self, host: HostNs) -> DeviceNs:
        """The host time itself."""
        return DeviceNs(host)


def first_packet(timestamp_us: int) -> HostNs:
    """Host time of a frame's first packet. To be called at once when the frame has been dequeued.

    libdc1394 gives the time in UTC, computed back from the moment of dequeuing. Both clocks are read now, so a step of
    UTC since the packet came does no harm.
    """
    before = host_now()
    utc = time.time_ns()
    after = host_now()
    return HostNs((before + after) // 2 - (utc - timestamp_us * NS_PER_US))
