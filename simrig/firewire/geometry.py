"""The Marlin F-080B's sensor, what of it is read out, and how it is cut into packets."""

from dataclasses import dataclass
from typing import Final

SENSOR: Final = (1032, 778)  #: width and height, px
VGA: Final = (640, 480)
SIZE_UNIT: Final = (4, 2)  #: steps of width and height in Format_7
POSITION_UNIT: Final = (4, 1)  #: of the first column and row
PACKET_UNIT: Final = 4  #: bytes
RATES_HZ: Final = {1: 3.75, 2: 7.5, 3: 15.0, 4: 30.0}  #: frame rates of Format_0 by the code in CUR_V_FRM_RATE
#: Largest isochronous packet by speed code (IEEE 1394-1995, 6.2.2.3): S100, S200, S400.
MAX_PACKET_BYTES: Final = {0: 1024, 1: 2048, 2: 4096}
CYCLES_AT_30_HZ: Final = 240  #: a Format_0 frame at 30 Hz has so many packets

_VGA_BYTES = VGA[0] * VGA[1]


@dataclass(frozen=True, slots=True)
class Readout:
    """A part of the sensor, Mono8, and its packets.

    Attributes:
        left: first column on the sensor.
        top: first row on the sensor.
        packet_bytes: of every packet; the last one is padded.
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
    """Packets that give 30 frames per second if they may be so long."""
    wanted = -(-width * height // CYCLES_AT_30_HZ)
    return min(limit, -(-wanted // PACKET_UNIT) * PACKET_UNIT)
