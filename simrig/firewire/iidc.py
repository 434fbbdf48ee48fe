"""The command registers of an IIDC 1.31 camera: formats, transmission, features, trigger (IIDC 1.31, chapter 4)."""

from collections.abc import Callable
from enum import IntEnum
from typing import Final

from simrig.firewire.bits import bit, field, with_field
from simrig.firewire.format7 import CSR as FORMAT7_CSR
from simrig.firewire.format7 import Format7
from simrig.firewire.geometry import MAX_PACKET_BYTES, RATES_HZ, Readout, vga

ADVANCED_BASE: Final = 0x1000000  #: of the maker's own registers, from the begin of the initial register space
SIZE: Final = 0x1000


class Register(IntEnum):
    """Offsets of what is read and written."""

    INITIALIZE = 0x000
    CUR_V_FRM_RATE = 0x600
    CUR_V_MODE = 0x604
    CUR_V_FORMAT = 0x608
    ISO_CHANNEL_SPEED = 0x60C
    ISO_EN = 0x614
    SOFTWARE_TRIGGER = 0x62C
    BRIGHTNESS = 0x800
    SHUTTER = 0x81C
    GAIN = 0x820
    TRIGGER_MODE = 0x830


_BASIC_FUNC_INQ, _FEATURE_HI_INQ, _ADV_FEATURE_INQ = 0x400, 0x404, 0x480
_FEATURE_INQ = 0x500 - 0x800  # from a feature's own register to its inquiry register
_PRESENT, _ABSENT = bit(0), 0
_ON = bit(6)
_POLARITY, _LEVEL = bit(7), bit(15)  # in the trigger's register
_READABLE, _SWITCHABLE, _MANUAL = bit(4), bit(5), bit(7)
_FORMAT_0, _FORMAT_7, _MODE_5 = 0, 7, 5


def _range(low: int, high: int) -> int:
    return _PRESENT | _READABLE | _MANUAL | low << 12 | high


#: Inquiry registers by offset: formats 0 and 7, their modes, rates, features and their ranges.
_INQUIRIES: Final[dict[int, int]] = {
    0x100: bit(_FORMAT_0) | bit(_FORMAT_7),
    0x180: bit(_MODE_5),
    0x19C: bit(0),
    0x200 + 4 * _MODE_5: sum(bit(code) for code in RATES_HZ),
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


class CommandRegisters:
    """Registers as the host sees them.

    Args:
        on_write: is told after each write that has an effect.
    """

    def __init__(self, on_write: Callable[[Register, int], None]) -> None:
        self.format7 = Format7()
        self._on_write = on_write
        self._values: dict[int, int] = dict(_DEFAULTS)

    def reset(self) -> None:
        """As after power-up."""
        self._values = dict(_DEFAULTS)
        self.format7.reset()
        self.format7.max_packet_bytes = MAX_PACKET_BYTES[self.speed]

    def read(self, offset: int) -> int:
        """A register; those that are not there read 0."""
        return self._values.get(offset, _INQUIRIES.get(offset, _ABSENT))

    def write(self, offset: int, value: int) -> None:
        """Write a register; inquiry registers and those that are not there swallow it."""
        if offset == Register.INITIALIZE:
            if value & bit(0):
                self.reset()
                self._on_write(Register.INITIALIZE, value)
            return
        if offset not in self._values:
            return
        register = Register(offset)
        self._values[register] = self._accepted(register, value)
        self.format7.max_packet_bytes = MAX_PACKET_BYTES[self.speed]
        self._on_write(register, value)

    def _accepted(self, register: Register, value: int) -> int:
        """What a register holds after a write."""
        if register in _FEATURES:
            inquiry = _INQUIRIES[register + _FEATURE_INQ]
            number = min(max(field(value, 20, 31), field(inquiry, 8, 19)), field(inquiry, 20, 31))
            return with_field(_PRESENT | _ON, 20, 31, number)
        accepted = value
        match register:
            case Register.TRIGGER_MODE:
                level = field(value, 12, 15) == 1
                accepted = _PRESENT | value & (_ON | _POLARITY) | (_LEVEL if level else 0)
            case Register.CUR_V_FRM_RATE if field(value, 0, 2) not in RATES_HZ:
                accepted = self._values[register]
            case Register.CUR_V_FORMAT if field(value, 0, 2) not in {_FORMAT_0, _FORMAT_7}:
                accepted = self._values[register]
            case Register.ISO_CHANNEL_SPEED if field(value, 6, 7) not in MAX_PACKET_BYTES:
                accepted = with_field(value, 6, 7, max(MAX_PACKET_BYTES))
            case Register.SOFTWARE_TRIGGER:
                accepted = 0  # over as soon as it has begun
            case _:
                pass
        return accepted

    @property
    def readout(self) -> Readout | None:
        """What is to be read out; None if the settings do not allow anything."""
        if field(self._values[Register.CUR_V_FORMAT], 0, 2) == _FORMAT_7:
            return self.format7.readout
        mode = field(self._values[Register.CUR_V_MODE], 0, 2)
        return vga(self.rate_hz) if mode == _MODE_5 else None

    @property
    def rate_hz(self) -> float:
        """Frame rate of Format_0."""
        return RATES_HZ[field(self._values[Register.CUR_V_FRM_RATE], 0, 2)]

    @property
    def transmitting(self) -> bool:
        """ISO_EN."""
        return bool(self._values[Register.ISO_EN] & bit(0))

    @property
    def channel(self) -> int:
        """Isochronous channel."""
        return field(self._values[Register.ISO_CHANNEL_SPEED], 0, 3)

    @property
    def speed(self) -> int:
        """0: 100, 1: 200, 2: 400 Mbit/s."""
        return field(self._values[Register.ISO_CHANNEL_SPEED], 6, 7)

    @property
    def shutter(self) -> int:
        """In units of the time base."""
        return field(self._values[Register.SHUTTER], 20, 31)

    @property
    def triggered(self) -> bool:
        """Whether triggers are waited for; if not, the camera runs free."""
        return bool(self._values[Register.TRIGGER_MODE] & _ON)

    @property
    def active_high(self) -> bool:
        """Polarity of the trigger input."""
        return bool(self._values[Register.TRIGGER_MODE] & _POLARITY)

    @property
    def trigger_mode(self) -> int:
        """0: an edge starts the exposure, the shutter ends it; 1: it lasts as long as the level."""
        return field(self._values[Register.TRIGGER_MODE], 12, 15)
