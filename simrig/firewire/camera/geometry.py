"""The Marlin F-080B's sensor, the part of it that is read out, and its packets; and bits of a quadlet.

IEEE 1394 and IIDC count the bits of a quadlet (32 bits) from the highest: bit 0 is the most significant.
"""

from dataclasses import dataclass
from typing import Final, Literal

SENSOR: Final = (1032, 778)  #: width and height, px
VGA: Final = (640, 480)
SIZE_UNIT: Final = (4, 2)  #: steps of width and height in Format_7
POSITION_UNIT: Final = (4, 1)  #: steps of the first column and row
PACKET_UNIT: Final = 4  #: step of the packet size, bytes
RATES_HZ: Final = {1: 3.75, 2: 7.5, 3: 15.0, 4: 30.0}  #: frame rates of Format_0 by the code in CUR_V_FRM_RATE
#: Largest isochronous packet by speed code (IEEE 1394-1995, 6.2.2.3): S100, S200, S400.
MAX_PACKET_BYTES: Final = {0: 1024, 1: 2048, 2: 4096}
CYCLES_AT_30_HZ: Final = 240  #: a Format_0 frame at 30 Hz has so many packets


#: Where the bytes of the signature are in an image of 16-bit pixels (the manual: in "4 bytes/pixels"): one behind the
#: other, or in the higher or lower byte of each pixel.
SignedBytes = Literal["together", "high", "low"]


@dataclass(frozen=True, slots=True)
class Deep:
    """How a camera sends pixels of more than 8 bits.

    Attributes:
        depth: significant bits, 10, 12 or 16.
        at_top: whether these are the highest bits of 16, as in AVT's cameras; in the standard they are the lowest.
        signed_bytes: where the signature is.
    """

    depth: Literal[10, 12, 16] = 10
    at_top: bool = True
    signed_bytes: SignedBytes = "together"


MARLIN: Final = Deep()


@dataclass(frozen=True, slots=True)
class Readout:
    """A part of the sensor, its pixels, and the size of its packets.

    Attributes:
        left: first column on the sensor.
        top: first row on the sensor.
        width: columns.
        height: rows.
        packet_bytes: bytes of each packet; the last one is padded.
        pixel_bytes: 1: Mono8, 2: Mono16.
    """

    left: int
    top: int
    width: int
    height: int
    packet_bytes: int
    pixel_bytes: int = 1

    @property
    def image_bytes(self) -> int:
        """Bytes of an image, without padding."""
        return self.width * self.height * self.pixel_bytes

    @property
    def packets(self) -> int:
        """Packets of a frame."""
        return -(-self.image_bytes // self.packet_bytes)

    @property
    def rows(self) -> slice:
        """Rows of the sensor."""
        return slice(self.top, self.top + self.height)

    @property
    def columns(self) -> slice:
        """Columns of the sensor."""
        return slice(self.left, self.left + self.width)


def vga(rate_hz: float, pixel_bytes: int = 1) -> Readout:
    """Format_0 Mode_5, or Mode_6 with two bytes a pixel: the middle of the sensor, in packets that give `rate_hz`."""
    left, top = (SENSOR[0] - VGA[0]) // 2, (SENSOR[1] - VGA[1]) // 2
    packets = round(CYCLES_AT_30_HZ * 30.0 / rate_hz)
    return Readout(left, top, *VGA, VGA[0] * VGA[1] * pixel_bytes // packets, pixel_bytes)


def recommended_packet_bytes(image_bytes: int, limit: int) -> int:
    """Packet size that gives 30 frames per second, at most `limit`."""
    wanted = -(-image_bytes // CYCLES_AT_30_HZ)
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
