"""AVT's own registers of the Marlin (its manual): versions, time base, extended shutter, input, image signature."""

import struct
from enum import IntEnum
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from simrig.firewire.camera.geometry import SENSOR, SignedBytes, bit, field

#: Byte order in which a camera signs its images (the manual does not say which); "none": firmware without signature.
Signature = Literal["big", "little", "none"]
SIZE: Final = 0x2000  #: of the register space, bytes


class Register(IntEnum):
    """Offsets in AVT's register space."""

    VERSION_INFO_1 = 0x010
    VERSION_INFO_3 = 0x018
    ADV_INQ_1 = 0x040
    ADV_INQ_2 = 0x044
    MAX_RESOLUTION = 0x200
    TIMEBASE = 0x208
    EXTD_SHUTTER = 0x20C
    IO_INP_CTRL1 = 0x300
    TIMESTAMP = 0x600
    FRMCNT_STAMP = 0x610
    FRMCNT = 0x614
    TRGCNT_STAMP = 0x620
    TRGCNT = 0x624


#: In their order in the image.
_STAMPS: Final = (Register.TIMESTAMP, Register.FRMCNT_STAMP, Register.TRGCNT_STAMP)

_OFFSETS: Final = frozenset(map(int, Register))
_MICROCONTROLLER_AND_FIRMWARE = 0x0003_0303  # firmware 3.03, the first with the signature
_CAMERA_ID_AND_FPGA = 0x0050_0303
_PRESENT, _ON, _RESET, _FORMAT_0 = bit(0), bit(6), bit(1), bit(8)
_INQUIRY_1 = sum(map(bit, (0, 1, 2, 6)))  # resolution, time base, extended shutter, version
_SIGNATURE_INQUIRY = sum(map(bit, (21, 22, 23)))  # time stamp, frame and trigger counter
_INQUIRY_2 = bit(0)  # input 1
_TIMEBASES_US: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
_DEFAULT_TIMEBASE = 4
_TRIGGER_INPUT = _PRESENT | bit(7) | 2 << 16  # active high; function "trigger"
_COUNT = 0xFFFFFFFF
_SHUTTER_OFFSET_US = 30  # of the F-080B
_WORDS: Final[dict[Signature, struct.Struct]] = {"big": struct.Struct(">I"), "little": struct.Struct("<I")}
_NEWEST_WITHOUT_SIGNATURE = 0x0003_0302


class AdvancedRegisters:
    """AVT's registers, and the counters that they show.

    Args:
        signature: byte order of the signature; "none": the registers of the signature are missing too.
        signed_bytes: where its bytes are in images of 16-bit pixels.

    Attributes:
        frames: frames read out of the sensor since the last reset of this counter.
        triggers: external triggers seen, likewise.
    """

    def __init__(self, signature: Signature = "big", signed_bytes: SignedBytes = "together") -> None:
        self._signature = signature
        self._first_and_step = {"together": (0, 1), "high": (0, 2), "low": (1, 2)}[signed_bytes]
        self.reset()

    def reset(self) -> None:
        """Set the state after power-up."""
        self.frames = self.triggers = 0
        self._timebase = _DEFAULT_TIMEBASE
        self._extended_us = 0
        self._input = _TRIGGER_INPUT
        self._on = dict.fromkeys(_STAMPS, False)
        self._line = 0

    def read(self, offset: int) -> int:
        """Read a register; an offset without a register reads 0."""
        registers = {
            Register.VERSION_INFO_1: _MICROCONTROLLER_AND_FIRMWARE if self._signs else _NEWEST_WITHOUT_SIGNATURE,
            Register.VERSION_INFO_3: _CAMERA_ID_AND_FPGA,
            Register.ADV_INQ_1: _INQUIRY_1 | (_SIGNATURE_INQUIRY if self._signs else 0),
            Register.ADV_INQ_2: _INQUIRY_2,
            Register.MAX_RESOLUTION: SENSOR[1] << 16 | SENSOR[0],
            Register.TIMEBASE: _PRESENT | self._timebase,
            Register.EXTD_SHUTTER: _PRESENT | self._extended_us,
            Register.IO_INP_CTRL1: self._input | 1,  # the open input reads 1
        }
        if self._signs:
            registers |= {Register.FRMCNT: self.frames, Register.TRGCNT: self.triggers}
            registers |= {stamp: self._stamp_register(stamp) for stamp in _STAMPS}
        return registers.get(Register(offset), 0) if offset in _OFFSETS else 0

    def write(self, offset: int, value: int) -> None:
        """Write a register; a write to one that only informs does nothing."""
        match offset:
            case Register.TIMEBASE if field(value, 28, 31) < len(_TIMEBASES_US):
                self._timebase = field(value, 28, 31)
            case Register.EXTD_SHUTTER:
                self._extended_us = field(value, 6, 31)
            case Register.IO_INP_CTRL1:
                self._input = _PRESENT | value & (bit(7) | 0x1F << 16)
            case Register.TIMESTAMP | Register.FRMCNT_STAMP | Register.TRGCNT_STAMP if self._signs:
                self._write_stamp(Register(offset), value)
            case _:
                return

    def leave_extended_shutter(self) -> None:
        """Switch back to the shutter register, as a write to shutter, format, mode or frame rate does."""
        self._extended_us = 0

    def exposure_us(self, shutter: int) -> int:
        """Exposure for a value of the shutter register, us."""
        return self._extended_us or shutter * _TIMEBASES_US[self._timebase] + _SHUTTER_OFFSET_US

    def count_trigger(self) -> None:
        """Count an external trigger."""
        self.triggers = self.triggers + 1 & _COUNT

    def count_frame(self) -> None:
        """Count a frame that was read out of the sensor."""
        self.frames = self.frames + 1 & _COUNT

    def sign(self, image: NDArray[np.uint8], words: tuple[int, int, int], pixel_bytes: int = 1) -> None:
        """Write the enabled words of the signature over the start of its line.

        Args:
            image: bytes as they are sent, shape (rows, bytes of a row).
            words: cycle time at the start of the integration, frame counter, trigger counter.
            pixel_bytes: bytes of a pixel.
        """
        if not any(self._on.values()) or not -len(image) <= self._line < len(image):
            return
        first, step = self._first_and_step if pixel_bytes > 1 else (0, 1)
        line = image[self._line, first::step]
        for index, (stamp, word) in enumerate(zip(_STAMPS, words, strict=True)):
            if self._on[stamp]:
                line[4 * index : 4 * index + 4] = np.frombuffer(_WORDS[self._signature].pack(word), np.uint8)

    @property
    def _signs(self) -> bool:
        return self._signature != "none"

    def _stamp_register(self, stamp: Register) -> int:
        inquiry = _PRESENT | (_FORMAT_0 if stamp == Register.TIMESTAMP else 0)
        return inquiry | (_ON if self._on[stamp] else 0) | self._line & 0xFFFF

    def _write_stamp(self, stamp: Register, value: int) -> None:
        if value & _RESET and stamp == Register.FRMCNT_STAMP:
            self.frames = 0
        if value & _RESET and stamp == Register.TRGCNT_STAMP:
            self.triggers = 0
        self._on[stamp] = bool(value & _ON)
        line = field(value, 16, 31)
        self._line = line - (1 << 16) if line >> 15 else line  # one line for all three
