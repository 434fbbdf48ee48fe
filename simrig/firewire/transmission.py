"""One frame on its way over the bus, as isochronous packets, one in each cycle."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.clocks import HostNs
from simrig.firewire.cycle_timer import CYCLE_NS, stamps

_TCODE_STREAM: Final = 0xA
_FIRST: Final = 1  # sync code of a frame's first packet (IIDC 1.31, 2.1.2); of the others 0


@dataclass(frozen=True, slots=True)
class Transmission:
    """A frame cut into packets.

    Attributes:
        channel: isochronous channel.
        data: pixels and padding, uint8, shape (packets * packet_bytes,).
        packet_bytes: of every packet.
        packets: so many.
        cycle: number of the cycle of the first packet.
        start: when that cycle begins.
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
    pulse: int

    @property
    def end(self) -> HostNs:
        """When the cycle of the last packet has ended."""
        return HostNs(self.start + self.packets * CYCLE_NS)

    def headers(self) -> NDArray[np.uint32]:
        """What the host's DMA keeps of each packet, big-endian, shape (packets, 2): header and cycle stamp."""
        table = np.empty((self.packets, 2), ">u4")
        table[:, 0] = self.packet_bytes << 16 | self.channel << 8 | _TCODE_STREAM << 4
        table[0, 0] |= _FIRST
        table[:, 1] = stamps(self.cycle + np.arange(self.packets, dtype=np.int64))
        return table
