"""Format_7 Mode_0: a free region of the sensor in packets of a free size (IIDC 1.31, 4.6)."""

from enum import IntEnum
from typing import Final

from simrig.firewire.bits import bit
from simrig.firewire.geometry import PACKET_UNIT, POSITION_UNIT, SENSOR, SIZE_UNIT, Readout, recommended_packet_bytes

CSR: Final = 0xF08000  #: where its registers are, from the begin of the initial register space
SIZE: Final = 0x100


class Register(IntEnum):
    """Offsets in the CSR of a mode."""

    MAX_IMAGE_SIZE = 0x00
    UNIT_SIZE = 0x04
    IMAGE_POSITION = 0x08
    IMAGE_SIZE = 0x0C
    COLOR_CODING_ID = 0x10
    COLOR_CODING_INQ = 0x14
    PIXEL_NUMBER = 0x34
    TOTAL_BYTES_LOW = 0x3C
    PACKET_PARAMETERS = 0x40
    BYTES_PER_PACKET = 0x44
    PACKETS_PER_FRAME = 0x48
    UNIT_POSITION = 0x4C
    DATA_DEPTH = 0x54
    VALUE_SETTING = 0x7C


_OFFSETS: Final = frozenset(map(int, Register))
_MONO8 = bit(0)
_REGION_ERROR, _PACKET_ERROR = bit(8), bit(9)


class Format7:
    """Registers of the mode. What is written takes effect at once; whether it is valid is told by VALUE_SETTING.

    Attributes:
        max_packet_bytes: at the present speed.
    """

    def __init__(self) -> None:
        self.max_packet_bytes = 4096
        self.reset()

    def reset(self) -> None:
        """The whole sensor."""
        self._left = self._top = 0
        self._width, self._height = SENSOR
        self._packet_bytes = 0

    @property
    def readout(self) -> Readout | None:
        """What is set; None if that is not possible."""
        packet_bytes = self._packet_bytes or self._recommended()
        if not self._region_fits() or not self._packet_fits(packet_bytes):
            return None
        return Readout(self._left, self._top, self._width, self._height, packet_bytes)

    def read(self, offset: int) -> int:
        """A register; those that are not there read 0."""
        readout = self.readout
        registers = {
            Register.MAX_IMAGE_SIZE: SENSOR[0] << 16 | SENSOR[1],
            Register.UNIT_SIZE: SIZE_UNIT[0] << 16 | SIZE_UNIT[1],
            Register.UNIT_POSITION: POSITION_UNIT[0] << 16 | POSITION_UNIT[1],
            Register.IMAGE_POSITION: self._left << 16 | self._top,
            Register.IMAGE_SIZE: self._width << 16 | self._height,
            Register.COLOR_CODING_ID: 0,  # Mono8
            Register.COLOR_CODING_INQ: _MONO8,
            Register.PIXEL_NUMBER: self._width * self._height,
            Register.TOTAL_BYTES_LOW: readout.packets * readout.packet_bytes if readout else 0,
            Register.PACKET_PARAMETERS: PACKET_UNIT << 16 | self.max_packet_bytes,
            Register.BYTES_PER_PACKET: (self._packet_bytes or self._recommended()) << 16 | self._recommended(),
            Register.PACKETS_PER_FRAME: readout.packets if readout else 0,
            Register.DATA_DEPTH: 8 << 24,
            Register.VALUE_SETTING: bit(0) | self._errors(),
        }
        return registers.get(Register(offset), 0) if offset in _OFFSETS else 0

    def write(self, offset: int, value: int) -> None:
        """Write a register; a new region goes with the packet size recommended for it, until one is written."""
        high, low = value >> 16, value & 0xFFFF
        match offset:
            case Register.IMAGE_POSITION:
                self._left, self._top = high, low
            case Register.IMAGE_SIZE:
                self._width, self._height, self._packet_bytes = high, low, 0
            case Register.BYTES_PER_PACKET:
                self._packet_bytes = high
            case _:
                return

    def _recommended(self) -> int:
        return recommended_packet_bytes(self._width, self._height, self.max_packet_bytes)

    def _region_fits(self) -> bool:
        places, sizes = (self._left, self._top), (self._width, self._height)
        return all(
            sizes[axis] > 0
            and places[axis] + sizes[axis] <= SENSOR[axis]
            and places[axis] % POSITION_UNIT[axis] == 0
            and sizes[axis] % SIZE_UNIT[axis] == 0
            for axis in (0, 1)
        )

    def _packet_fits(self, packet_bytes: int) -> bool:
        return 0 < packet_bytes <= self.max_packet_bytes and packet_bytes % PACKET_UNIT == 0

    def _errors(self) -> int:
        region = 0 if self._region_fits() else _REGION_ERROR
        packet = 0 if self._packet_fits(self._packet_bytes or self._recommended()) else _PACKET_ERROR
        return region | packet
