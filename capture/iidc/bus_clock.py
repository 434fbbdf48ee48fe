"""The clock that a FireWire camera's frames are stamped with, against the host's monotonic clock.

Two kinds. With a signature it is the bus's cycle timer, common to all cameras on the bus. Without one there is only the
time at which the first packet came, which the kernel tells in 125 us steps: that clock *is* the host's.
"""

import time
from typing import Final, Protocol

from capture.iidc.cycle_time import CYCLE_NS, CycleTime, unwrap
from capture.iidc.device import Device
from rig.clocks import NS_PER_US, ClockLatch, DeviceNs, HostNs, host_now

_TRIES: Final = 5


class BusClock(Protocol):
    """The camera's clock, as the frames use it."""

    def latch(self) -> ClockLatch:
        """Read it against the host's.

        Raises:
            Dc1394Error: the card does not answer.
        """
        ...

    def at(self, host: HostNs) -> DeviceNs:
        """What it shows at a host time near the last latch."""
        ...


class CycleTimer:
    """The bus's cycle timer, unwrapped.

    Two grabbers on one bus should tell the same time, so each begins with the one nearest to the host's clock.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        now = host_now()
        self._last = ClockLatch(DeviceNs(now), now, 0)
        self.latch()

    def latch(self) -> ClockLatch:
        """The shortest of several round trips."""
        self._last = min((self._read() for _ in range(_TRIES)), key=lambda latch: latch.round_trip_ns)
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
    """For cameras without a signature: the host's clock itself, but read only in steps of a bus cycle."""

    def latch(self) -> ClockLatch:
        """Known by definition; frames are not known better than to a cycle either way."""
        now = host_now()
        return ClockLatch(DeviceNs(now), now, 2 * CYCLE_NS)

    def at(self, host: HostNs) -> DeviceNs:
        """The same."""
        return DeviceNs(host)


def first_packet(timestamp_us: int) -> HostNs:
    """Host time of a frame's first packet. To be called at once when the frame has been dequeued.

    libdc1394 tells it as UTC, reckoned back from the moment of dequeuing. Reckoned forward again with both clocks read
    now, it does not matter if UTC has been stepped since the packet came.
    """
    before = host_now()
    utc = time.time_ns()
    after = host_now()
    return HostNs((before + after) // 2 - (utc - timestamp_us * NS_PER_US))
