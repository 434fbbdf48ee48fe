"""The isochronous resource manager: who may send on which channel, and how much per cycle."""

import errno
from dataclasses import dataclass
from typing import Final

BANDWIDTH_UNITS: Final = 4915  #: per cycle: 100 of 125 us, a unit is 20.3 ns
CHANNELS: Final = 64


@dataclass(frozen=True, slots=True)
class Allocation:
    """What one request got; a negative channel is an error number (also if only bandwidth was asked for)."""

    channel: int
    bandwidth: int

    @property
    def granted(self) -> bool:
        """Whether anything was allocated."""
        return self.channel >= 0 or self.bandwidth > 0


class IsoResources:
    """Channels and bandwidth of one bus."""

    def __init__(self) -> None:
        self.bandwidth = BANDWIDTH_UNITS
        self.taken = 0  #: bit mask of channels

    def allocate(self, channels: int, bandwidth: int) -> Allocation:
        """Allocate the lowest free channel of a mask, or bandwidth, or both; all or nothing.

        As in the kernel (fw_iso_resource_manage), failure is told by the channel, whatever was not to be had.
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
        """Give back what was granted."""
        self.bandwidth += allocation.bandwidth
        if allocation.channel >= 0:
            self.taken &= ~(1 << allocation.channel)
