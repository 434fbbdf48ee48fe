"""Isochronous transfer on the bus: the cycle timer that all nodes share, frames as packets, channels and bandwidth.

The timer runs at 24.576 MHz, in cycles of 3072 ticks or 125 us. A camera sends one packet of its frame in each cycle.
"""

import errno
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.clocks import HostNs
from rig.pulse import HillPulse

CYCLE_NS: Final = 125_000
TICKS_PER_CYCLE: Final = 3072
CYCLES_PER_S: Final = 8000
_WRAP_S: Final = 128  # the register has 7 bits for seconds
_STAMP_WRAP_S: Final = 8  # the stamp of a packet has 3
BANDWIDTH_UNITS: Final = 4915  #: per cycle: 100 of 125 us; a unit is 20.3 ns
CHANNELS: Final = 64
_TCODE_STREAM: Final = 0xA
_FIRST: Final = 1  # sync code of a frame's first packet (IIDC 1.31, 2.1.2); the others have 0


class CycleTimer:
    """The cycle timer of the cycle master, which all other nodes follow.

    Args:
        master: gives the reading of the cycle master's own clock at a host time, ns.
    """

    def __init__(self, master: Callable[[HostNs], int]) -> None:
        self._master = master

    def ticks(self, host: HostNs) -> int:
        """Ticks since the clock's zero, without wrapping."""
        return self._master(host) * TICKS_PER_CYCLE // CYCLE_NS

    def register(self, host: HostNs) -> int:
        """The register CYCLE_TIME: seconds (7 bits), cycles (13 bits), ticks (12 bits)."""
        cycle, offset = divmod(self.ticks(host), TICKS_PER_CYCLE)
        second, cycle = divmod(cycle, CYCLES_PER_S)
        return second % _WRAP_S << 25 | cycle << 12 | offset

    def next_cycle(self, host: HostNs) -> tuple[int, HostNs]:
        """Number and start of the first cycle that starts at `host` or later."""
        ticks = self.ticks(host)
        cycle = -(-ticks // TICKS_PER_CYCLE)
        return cycle, HostNs(host + (cycle * TICKS_PER_CYCLE - ticks) * CYCLE_NS // TICKS_PER_CYCLE)


@dataclass(frozen=True, slots=True)
class Transmission:
    """A frame as a camera sends it, one packet in each cycle.

    Attributes:
        channel: isochronous channel.
        data: pixels and padding, uint8, shape (packets * packet_bytes,).
        packet_bytes: bytes of each packet.
        packets: number of packets.
        cycle: number of the cycle of the first packet.
        start: when that cycle starts.
        lost: numbers, from 0, of the packets that do not arrive anywhere.
        pulse: hill pulse that the frame shows.
    """

    channel: int
    data: NDArray[np.uint8]
    packet_bytes: int
    packets: int
    cycle: int
    start: HostNs
    lost: frozenset[int]
    pulse: HillPulse

    @property
    def end(self) -> HostNs:
        """When the cycle of the last packet ends."""
        return HostNs(self.start + self.packets * CYCLE_NS)

    def headers(self) -> NDArray[np.uint32]:
        """What the host's DMA keeps of each packet, big-endian, shape (packets, 2): header and 16-bit cycle stamp."""
        cycles = self.cycle + np.arange(self.packets, dtype=np.int64)
        table = np.empty((self.packets, 2), ">u4")
        table[:, 0] = self.packet_bytes << 16 | self.channel << 8 | _TCODE_STREAM << 4
        table[0, 0] |= _FIRST
        table[:, 1] = cycles // CYCLES_PER_S % _STAMP_WRAP_S << 13 | cycles % CYCLES_PER_S
        return table


@dataclass(frozen=True, slots=True)
class Allocation:
    """Result of one request. A negative channel is an error number, also if only bandwidth was requested."""

    channel: int
    bandwidth: int

    @property
    def granted(self) -> bool:
        """Whether anything was allocated."""
        return self.channel >= 0 or self.bandwidth > 0


class IsoResources:
    """The isochronous resource manager: free channels and bandwidth of one bus."""

    def __init__(self) -> None:
        self.bandwidth = BANDWIDTH_UNITS
        self.taken = 0  #: bit mask of channels

    def allocate(self, channels: int, bandwidth: int) -> Allocation:
        """Allocate the lowest free channel of a mask, or bandwidth, or both; all or nothing.

        As in the kernel (fw_iso_resource_manage), the channel reports failure, even if the bandwidth was short.
        """
        free = [channel for channel in range(CHANNELS) if channels >> channel & 1 and not self.taken >> channel & 1]
        if channels and not free:
            return Allocation(-errno.EBUSY, 0)
        if bandwidth > self.bandwidth:
            return Allocation(-errno.EBUSY, 0)
        self.bandwidth -= bandwidth
        if not channels:
            return Allocation(-errno.EINVAL, bandwidth)
        self.taken |= 1 << free[0]
        return Allocation(free[0], bandwidth)

    def free(self, allocation: Allocation) -> None:
        """Return what was granted."""
        self.bandwidth += allocation.bandwidth
        if allocation.channel >= 0:
            self.taken &= ~(1 << allocation.channel)
