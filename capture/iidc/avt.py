"""The advanced registers of AVT's cameras (Marlin technical manual, chapter "Advanced features").

Offsets are relative to 0xFFFFF1000000. Bit 0 of the standard is the most significant; it says that a register is there.
"""

from typing import Final

from capture.iidc.device import Device
from capture.iidc.library import Dc1394Error

AVT_VENDOR_ID: Final = 0x000A47

_TIMEBASE, _EXTENDED_SHUTTER = 0x208, 0x20C
_SIGNATURE, _FRAME_COUNTER, _TRIGGER_COUNTER = 0x600, 0x610, 0x620
_COUNT: Final = 4  # a counter's value stands in the register after its control
_PRESENT, _ON, _RESET = 0x8000_0000, 0x0200_0000, 0x4000_0000
_LAST_LINE: Final = 0xFFFF  # line -1, as 16 bits with sign
_LONGEST_US: Final = 0x3FF_FFFF
_TIMEBASES_US: Final = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
_STEPS: Final = 4095  # of the ordinary shutter


class AvtRegisters:
    """What AVT's cameras can do beyond the standard.

    Args:
        device: an open camera of any maker.

    Attributes:
        signs: it can write a secure image signature.
        extended_shutter: its exposure can be set in microseconds.
    """

    def __init__(self, device: Device) -> None:
        self._device = device
        avt = device.vendor_id == AVT_VENDOR_ID and device.has_advanced_registers
        self._avt = avt
        self.signs = avt and all(self._has(place) for place in (_SIGNATURE, _FRAME_COUNTER, _TRIGGER_COUNTER))
        self.extended_shutter = avt and self._has(_EXTENDED_SHUTTER)

    def sign_last_line(self) -> None:
        """Cycle time, frame and trigger counter into the last line's first pixels; both counters begin at 0.

        In the last line, because after any lost packet it is no longer where it should be.
        """
        self._device.write_advanced(_SIGNATURE, _ON | _LAST_LINE)
        for counter in (_FRAME_COUNTER, _TRIGGER_COUNTER):
            self._device.write_advanced(counter, _RESET | _ON | _LAST_LINE)

    def sign_nothing(self) -> None:
        """All pixels are picture."""
        for register in (_SIGNATURE, _FRAME_COUNTER, _TRIGGER_COUNTER):
            self._device.write_advanced(register, _LAST_LINE)

    def still_signs(self) -> bool:
        """Whether the signature is still switched on as we did it."""
        return self._device.read_advanced(_SIGNATURE) & (_ON | _LAST_LINE) == _ON | _LAST_LINE

    def counters(self) -> tuple[int, int]:
        """Frames read out of the sensor, trigger pulses seen."""
        frames = self._device.read_advanced(_FRAME_COUNTER + _COUNT)
        return frames, self._device.read_advanced(_TRIGGER_COUNTER + _COUNT)

    def set_extended_shutter(self, exposure_us: float) -> None:
        """Exposure in microseconds. Inactive again after any change of format or rate: write it last."""
        self._device.write_advanced(_EXTENDED_SHUTTER, min(_LONGEST_US, max(1, round(exposure_us))))

    def shutter_steps(self, exposure_us: float, offset_us: float) -> int | None:
        """The ordinary shutter's value for an exposure; None if it cannot be told or does not fit."""
        if not (self._avt and self._has(_TIMEBASE)):
            return None
        number = self._device.read_advanced(_TIMEBASE) & 0xF
        if number >= len(_TIMEBASES_US):
            return None
        steps = round((exposure_us - offset_us) / _TIMEBASES_US[number])
        return steps if 1 <= steps <= _STEPS else None

    def _has(self, register: int) -> bool:
        try:
            return bool(self._device.read_advanced(register) & _PRESENT)
        except Dc1394Error:
            return False  # older firmware answers with an address error: the register is not there
