"""Point Grey's own registers on FireWire: information in the first pixels, shutter in seconds, Trigger_Mode_14.

Source: Point Grey digital camera register reference (FRAME_INFO, ABS_CSR_HI_INQ). As with AVT's, agreement of a program
with this is agreement with our reading of that, not with a camera.
"""

import struct
from typing import Final

import numpy as np
from numpy.typing import NDArray

from simrig.firewire.camera.advanced import AdvancedRegisters
from simrig.firewire.camera.config_rom import COMMAND_BASE
from simrig.firewire.camera.geometry import bit
from simrig.firewire.camera.iidc import (
    FORMAT7_CSR,
    FORMAT7_MODES_INQ,
    FORMAT7_SIZE,
    SHUTTER_INQ,
    TRIGGER_INQ,
    standard_inquiry,
)

VENDOR_ID: Final = 0x00B09D
#: Offsets from the start of the command registers: shutter in seconds (least, greatest, present) and the information.
_ABSOLUTE, _FRAME_INFO = 0x1800, 0x12F8
_SHUTTER_ABSOLUTE_INQ, _FORMAT7_MODE_1_INQ = 0x71C, 0x2E4
_LEAST_S, _GREATEST_S = 20e-6, 0.1
_FRAMES, _TIME = bit(25), bit(31)
_PRESENT: Final = bit(0)
_INSERTED: Final = _FRAMES | _TIME
#: What such a camera says of itself beside what every camera says.
INQUIRIES: Final = {
    FORMAT7_MODES_INQ: bit(0) | bit(1),
    _FORMAT7_MODE_1_INQ: (FORMAT7_CSR + FORMAT7_SIZE) // 4,
    SHUTTER_INQ: standard_inquiry(SHUTTER_INQ) | bit(1),
    TRIGGER_INQ: standard_inquiry(TRIGGER_INQ) | bit(16 + 14),
    _SHUTTER_ABSOLUTE_INQ: (COMMAND_BASE + _ABSOLUTE) // 4,
}


class PointGreyRegisters(AdvancedRegisters):
    """See above; it has none of AVT's registers."""

    def reset(self) -> None:
        """Set the state after power-up."""
        super().reset()
        self._shutter_s, self._inserted = 0.005, 0

    def read(self, offset: int) -> int:
        """Read one of the registers where AVT's are: there are none."""
        del offset
        return 0

    def write(self, offset: int, value: int) -> None:
        """Write there: nothing happens."""

    def read_command(self, offset: int) -> int | None:
        """Read a register behind the command registers; None if there is none."""
        if offset == _FRAME_INFO:
            return _PRESENT | self._inserted
        place = (offset - _ABSOLUTE) // 4
        if not 0 <= place < 3:
            return None
        word: int = struct.unpack(">I", struct.pack(">f", (_LEAST_S, _GREATEST_S, self._shutter_s)[place]))[0]
        return word

    def write_command(self, offset: int, value: int) -> bool:
        """Write such a register; whether it is there."""
        if offset == _FRAME_INFO:
            self._inserted = value & _INSERTED
        elif offset == _ABSOLUTE + 8:
            wanted = struct.unpack(">f", struct.pack(">I", value))[0]
            self._shutter_s = min(max(wanted, _LEAST_S), _GREATEST_S)
        return self.read_command(offset) is not None

    def exposure_us(self, shutter: int) -> int:
        """Exposure, us; the shutter in steps is not used."""
        del shutter
        return round(self._shutter_s * 1e6)

    def sign(self, image: NDArray[np.uint8], words: tuple[int, int, int], pixel_bytes: int = 1) -> None:
        """Write what is inserted over the first bytes of the image, the time first."""
        del pixel_bytes
        chosen = [word for word, flag in zip(words, (_TIME, _FRAMES, 0), strict=True) if self._inserted & flag]
        data = struct.pack(f">{len(chosen)}I", *chosen)
        image.reshape(-1)[: len(data)] = np.frombuffer(data, np.uint8)
