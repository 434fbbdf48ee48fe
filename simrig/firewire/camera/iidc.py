"""The registers of an IIDC 1.31 camera: command registers (chapter 4) and those of Format_7 Mode_0 (4.6).

In Format_7 a program chooses a free region of the sensor and the size of the packets.
"""

from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Final

from simrig.firewire.camera.geometry import (
    MAX_PACKET_BYTES,
    PACKET_UNIT,
    POSITION_UNIT,
    RATES_HZ,
    SENSOR,
    SIZE_UNIT,
    Readout,
    bit,
    field,
    recommended_packet_bytes,
    vga,
    with_field,
)

ADVANCED_BASE: Final = 0x1000000  #: start of the maker's own registers, from the start of the initial register space
SIZE: Final = 0x1000  #: of the command registers, bytes
FORMAT7_CSR: Final = 0xF08000  #: start of the registers of Format_7 Mode_0, likewise
FORMAT7_SIZE: Final = 0x100  #: their size, bytes; those of Mode_1 follow
FORMAT7_MODES_INQ: Final = 0x19C  #: inquiry registers that makers extend
SHUTTER_INQ, TRIGGER_INQ = 0x51C, 0x530


class Register(IntEnum):
    """Offsets of registers that hold a setting."""

    INITIALIZE = 0x000
    CUR_V_FRM_RATE = 0x600
    CUR_V_MODE = 0x604
    CUR_V_FORMAT = 0x608
    ISO_CHANNEL_SPEED = 0x60C
    ISO_EN = 0x614
    SOFTWARE_TRIGGER = 0x62C
    DATA_DEPTH = 0x630
    BRIGHTNESS = 0x800
    SHUTTER = 0x81C
    GAIN = 0x820
    TRIGGER_MODE = 0x830


_BASIC_FUNC_INQ, _FEATURE_HI_INQ, _ADV_FEATURE_INQ = 0x400, 0x404, 0x480
_FEATURE_INQ = 0x500 - 0x800  # from a feature's own register to its inquiry register
_PRESENT, _ABSENT = bit(0), 0
_ON = bit(6)
_POLARITY = bit(7)  # in the trigger's register
_READABLE, _SWITCHABLE, _MANUAL = bit(4), bit(5), bit(7)
_FORMAT_0, _FORMAT_7, _MODE_5, _MODE_6 = 0, 7, 5, 6
#: Color codings of Format_7: 8 and 16 bits.
_MONO8, _MONO16 = 0, 5


def _range(low: int, high: int) -> int:
    return _PRESENT | _READABLE | _MANUAL | low << 12 | high


#: Inquiry registers by offset: formats 0 and 7, their modes, rates, features and their ranges.
_INQUIRIES: Final[dict[int, int]] = {
    0x100: bit(_FORMAT_0) | bit(_FORMAT_7),
    0x180: bit(_MODE_5) | bit(_MODE_6),
    FORMAT7_MODES_INQ: bit(0),
    **{0x200 + 4 * mode: sum(bit(code) for code in RATES_HZ) for mode in (_MODE_5, _MODE_6)},
    0x2E0: FORMAT7_CSR // 4,
    _BASIC_FUNC_INQ: bit(0),  # there are advanced features
    _FEATURE_HI_INQ: bit(0) | bit(7) | bit(8) | bit(12),  # brightness, shutter, gain, trigger
    _ADV_FEATURE_INQ: ADVANCED_BASE // 4,
    Register.BRIGHTNESS + _FEATURE_INQ: _range(0, 255),
    Register.SHUTTER + _FEATURE_INQ: _range(1, 4095),
    Register.GAIN + _FEATURE_INQ: _range(0, 680),
    # on/off, polarity, source 0, modes 0 and 1
    Register.TRIGGER_MODE + _FEATURE_INQ: _PRESENT | _READABLE | _SWITCHABLE | bit(6) | bit(8) | bit(16) | bit(17),
}


def standard_inquiry(offset: int) -> int:
    """What every emulated camera answers at an inquiry register."""
    return _INQUIRIES[offset]


#: After power-up: 640 x 480 at 30 Hz, shutter 40 ms, trigger off.
_DEFAULTS: Final[dict[int, int]] = {
    Register.CUR_V_FRM_RATE: 4 << 29,
    Register.CUR_V_MODE: _MODE_5 << 29,
    Register.CUR_V_FORMAT: _FORMAT_0 << 29,
    Register.ISO_CHANNEL_SPEED: 2 << 24,
    Register.ISO_EN: 0,
    Register.SOFTWARE_TRIGGER: 0,
    Register.BRIGHTNESS: _PRESENT | _ON | 16,
    Register.SHUTTER: _PRESENT | _ON | 2000,
    Register.GAIN: _PRESENT | _ON,
    Register.TRIGGER_MODE: _PRESENT | _POLARITY,
}
_FEATURES: Final = (Register.BRIGHTNESS, Register.SHUTTER, Register.GAIN)


class Format7Register(IntEnum):
    """Offsets of the registers of a mode of Format_7."""

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


_FORMAT7_OFFSETS: Final = frozenset(map(int, Format7Register))
_REGION_ERROR, _PACKET_ERROR = bit(8), bit(9)


class Format7:
    """Registers of a mode of Format_7. A write takes effect at once; VALUE_SETTING says whether the settings are valid.

    Args:
        depth: significant bits of 16-bit pixels.

    Attributes:
        max_packet_bytes: largest packet at the present speed.
    """

    def __init__(self, depth: int) -> None:
        self.max_packet_bytes = 4096
        self._depth = depth
        self.reset()

    def reset(self) -> None:
        """Select the whole sensor."""
        self._left = self._top = 0
        self._width, self._height = SENSOR
        self._packet_bytes = 0
        self._coding = _MONO8

    @property
    def readout(self) -> Readout | None:
        """The selected readout; None if the settings are not valid."""
        packet_bytes = self._packet_bytes or self._recommended()
        if not self._region_fits() or not self._packet_fits(packet_bytes):
            return None
        return Readout(self._left, self._top, self._width, self._height, packet_bytes, self._pixel_bytes)

    def read(self, offset: int) -> int:
        """Read a register; an offset without a register reads 0."""
        readout = self.readout
        registers = {
            Format7Register.MAX_IMAGE_SIZE: SENSOR[0] << 16 | SENSOR[1],
            Format7Register.UNIT_SIZE: SIZE_UNIT[0] << 16 | SIZE_UNIT[1],
            Format7Register.UNIT_POSITION: POSITION_UNIT[0] << 16 | POSITION_UNIT[1],
            Format7Register.IMAGE_POSITION: self._left << 16 | self._top,
            Format7Register.IMAGE_SIZE: self._width << 16 | self._height,
            Format7Register.COLOR_CODING_ID: self._coding << 24,
            Format7Register.COLOR_CODING_INQ: bit(_MONO8) | bit(_MONO16),
            Format7Register.PIXEL_NUMBER: self._width * self._height,
            Format7Register.TOTAL_BYTES_LOW: readout.packets * readout.packet_bytes if readout else 0,
            Format7Register.PACKET_PARAMETERS: PACKET_UNIT << 16 | self.max_packet_bytes,
            Format7Register.BYTES_PER_PACKET: (self._packet_bytes or self._recommended()) << 16 | self._recommended(),
            Format7Register.PACKETS_PER_FRAME: readout.packets if readout else 0,
            Format7Register.DATA_DEPTH: self.depth << 24,
            Format7Register.VALUE_SETTING: bit(0) | self._errors(),
        }
        return registers.get(Format7Register(offset), 0) if offset in _FORMAT7_OFFSETS else 0

    def write(self, offset: int, value: int) -> None:
        """Write a register; a new region selects its recommended packet size, until a program writes one."""
        high, low = value >> 16, value & 0xFFFF
        match offset:
            case Format7Register.IMAGE_POSITION:
                self._left, self._top = high, low
            case Format7Register.IMAGE_SIZE:
                self._width, self._height, self._packet_bytes = high, low, 0
            case Format7Register.COLOR_CODING_ID if field(value, 0, 7) in {_MONO8, _MONO16}:
                self._coding, self._packet_bytes = field(value, 0, 7), 0
            case Format7Register.BYTES_PER_PACKET:
                self._packet_bytes = high
            case _:
                return

    @property
    def depth(self) -> int:
        """Significant bits of a pixel."""
        return self._depth if self._coding == _MONO16 else 8

    @property
    def _pixel_bytes(self) -> int:
        return 2 if self._coding == _MONO16 else 1

    def _recommended(self) -> int:
        return recommended_packet_bytes(self._width * self._height * self._pixel_bytes, self.max_packet_bytes)

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


class CommandRegisters:
    """The camera's command registers.

    Args:
        on_write: called after each write that has an effect.
        depth: significant bits of 16-bit pixels.
        inquiries: what the camera says beside, or instead of, what every camera says, by offset.
    """

    def __init__(
        self, on_write: Callable[[Register, int], None], depth: int, inquiries: Mapping[int, int] | None = None
    ) -> None:
        self.format7_modes = (Format7(depth), Format7(depth))
        self._inquiries = _INQUIRIES | dict(inquiries or {})
        self._depth = depth
        self._on_write = on_write
        self._values: dict[int, int] = dict(_DEFAULTS)

    def reset(self) -> None:
        """Set the state after power-up."""
        self._values = dict(_DEFAULTS)
        for mode in self.format7_modes:
            mode.reset()
            mode.max_packet_bytes = MAX_PACKET_BYTES[self.speed]

    def read(self, offset: int) -> int:
        """Read a register; an offset without a register reads 0."""
        if offset == Register.DATA_DEPTH:
            return self.depth << 24
        return self._values.get(offset, self._inquiries.get(offset, _ABSENT))

    def write(self, offset: int, value: int) -> None:
        """Write a register; a write to an inquiry register, or where there is none, does nothing."""
        if offset == Register.INITIALIZE:
            if value & bit(0):
                self.reset()
                self._on_write(Register.INITIALIZE, value)
            return
        if offset not in self._values:
            return
        register = Register(offset)
        self._values[register] = self._accepted(register, value)
        for mode in self.format7_modes:
            mode.max_packet_bytes = MAX_PACKET_BYTES[self.speed]
        self._on_write(register, value)

    def _accepted(self, register: Register, value: int) -> int:
        """Value of a register after a write."""
        if register in _FEATURES:
            inquiry = _INQUIRIES[register + _FEATURE_INQ]
            number = min(max(field(value, 20, 31), field(inquiry, 8, 19)), field(inquiry, 20, 31))
            return with_field(_PRESENT | _ON, 20, 31, number)
        accepted = value
        match register:
            case Register.TRIGGER_MODE:
                mode = field(value, 12, 15)
                mode = mode if self._inquiries[TRIGGER_INQ] & bit(16 + mode) else 0
                accepted = with_field(_PRESENT | value & (_ON | _POLARITY), 12, 15, mode)
            case Register.CUR_V_FRM_RATE if field(value, 0, 2) not in RATES_HZ:
                accepted = self._values[register]
            case Register.CUR_V_FORMAT if field(value, 0, 2) not in {_FORMAT_0, _FORMAT_7}:
                accepted = self._values[register]
            case Register.ISO_CHANNEL_SPEED if field(value, 6, 7) not in MAX_PACKET_BYTES:
                accepted = with_field(value, 6, 7, max(MAX_PACKET_BYTES))
            case Register.SOFTWARE_TRIGGER:
                accepted = 0  # the register resets itself
            case _:
                pass
        return accepted

    @property
    def format7(self) -> Format7:
        """The registers of the mode of Format_7 that is set."""
        return self.format7_modes[self._mode]

    @property
    def readout(self) -> Readout | None:
        """The selected readout; None if the settings are not valid."""
        if self._is_format7:
            return self.format7.readout if self._mode < len(self.format7_modes) else None
        if self._mode not in {_MODE_5, _MODE_6}:
            return None
        readout = vga(self.rate_hz, 2 if self._mode == _MODE_6 else 1)
        return readout if readout.packet_bytes <= MAX_PACKET_BYTES[self.speed] else None

    @property
    def depth(self) -> int:
        """Significant bits of a pixel."""
        if self._is_format7:
            return self.format7.depth
        return self._depth if self._mode == _MODE_6 else 8

    @property
    def _is_format7(self) -> bool:
        return field(self._values[Register.CUR_V_FORMAT], 0, 2) == _FORMAT_7

    @property
    def _mode(self) -> int:
        return field(self._values[Register.CUR_V_MODE], 0, 2)

    @property
    def rate_hz(self) -> float:
        """Frame rate of Format_0."""
        return RATES_HZ[field(self._values[Register.CUR_V_FRM_RATE], 0, 2)]

    @property
    def transmitting(self) -> bool:
        """Whether the camera transmits (ISO_EN)."""
        return bool(self._values[Register.ISO_EN] & bit(0))

    @property
    def channel(self) -> int:
        """Isochronous channel."""
        return field(self._values[Register.ISO_CHANNEL_SPEED], 0, 3)

    @property
    def speed(self) -> int:
        """Speed code, 0: 100, 1: 200, 2: 400 Mbit/s."""
        return field(self._values[Register.ISO_CHANNEL_SPEED], 6, 7)

    @property
    def shutter(self) -> int:
        """Shutter in units of the time base."""
        return field(self._values[Register.SHUTTER], 20, 31)

    @property
    def triggered(self) -> bool:
        """Whether the camera waits for triggers; if not, it runs free."""
        return bool(self._values[Register.TRIGGER_MODE] & _ON)

    @property
    def active_high(self) -> bool:
        """Polarity of the trigger input."""
        return bool(self._values[Register.TRIGGER_MODE] & _POLARITY)

    @property
    def trigger_mode(self) -> int:
        """Trigger mode, 0: an edge starts the exposure, the shutter ends it; 1: it lasts as long as the level."""
        return field(self._values[Register.TRIGGER_MODE], 12, 15)
