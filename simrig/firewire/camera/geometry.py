"""The Marlin F-080B's sensor, the part of it that is read out, and its packets; and bits of a quadlet.

IEEE 1394 and IIDC count the bits of a quadlet (32 bits) from the highest: bit 0 is the most significant.
"""

from dataclasses import dataclass
from typing import Final

SENSOR: Final = (1032, 778)  #: width and height, px
VGA: Final = (640, 480)
SIZE_UNIT: Final = (4, 2)  #: steps of width and height in Format_7
POSITION_UNIT: Final = (4, 1)  #: steps of the first column and row
PACKET_UNIT: Final = 4  #: step of the packet size, bytes
RATES_HZ: Final = {1: 3.75, 2: 7.5, 3: 15.0, 4: 30.0}  #: frame rates of Format_0 by the code in CUR_V_FRM_RATE
#: Largest isochronous packet by speed code (IEEE 1394-1995, 6.2.2.3): S100, S200, S400.
MAX_PACKET_BYTES: Final = {0: 1024, 1: 2048, 2: 4096}
CYCLES_AT_30_HZ: Final = 240  #: a Format_0 frame at 30 Hz has so many packets

_VGA_BYTES = VGA[0] * VGA[1]


@dataclass(frozen=True, slots=True)
class Readout:
    """A part of the sensor, Mono8, and the size of its packets.

    Attributes:
        left: first column on the sensor.
        top: first row on the sensor.
        width: columns.
        height: rows.
        packet_bytes: bytes of each packet; the last one is padded.
    """

    left: int
    top: int
    width: int
    height: int
    packet_bytes: int

    @property
    def packets(self) -> int:
        """Packets of a frame."""
        return -(-self.width * self.height // self.packet_bytes)

    @property
    def rows(self) -> slice:
        """Rows of the sensor."""
        return slice(self.top, self.top + self.height)

    @property
    def columns(self) -> slice:
        """Columns of the sensor."""
        return slice(self.left, self.left + self.width)


def vga(rate_hz: float) -> Readout:
    """Format_0 Mode_5: the middle of the sensor, in packets that give `rate_hz`."""
    left, top = (SENSOR[0] - VGA[0]) // 2, (SENSOR[1] - VGA[1]) // 2
    packets = round(CYCLES_AT_30_HZ * 30.0 / rate_hz)
    return Readout(left, top, *VGA, _VGA_BYTES // packets)


def recommended_packet_bytes(width: int, height: int, limit: int) -> int:
    """Packet size that gives 30 frames per second, at most `limit`."""
    wanted = -(-width * height // CYCLES_AT_30_HZ)
    return min(limit, -(-wanted // PACKET_UNIT) * PACKET_UNIT)


def bit(number: int) -> int:
    """A quadlet with this bit set."""
    return 1 << (31 - number)


def field(value: int, first: int, last: int) -> int:
    """Bits `first` to `last` of a quadlet."""
    return value >> (31 - last) & ((1 << (last - first + 1)) - 1)


def with_field(value: int, first: int, last: int, content: int) -> int:
    """The quadlet with bits `first` to `last` replaced."""
    mask = ((1 << (last - first + 1)) - 1) << (31 - last)
    return value & ~mask | (content << (31 - last) & mask)
