"""What AVT's cameras can do beyond the standard: sign frames, count triggers, set the exposure in microseconds.

Source: Marlin technical manual, chapter "Advanced features". Offsets are relative to 0xFFFFF1000000. Bits are counted
from the most significant one, as in the standard; bit 0 of a register says whether the camera has it.
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
_SHUTTER_STEPS: Final = 4095  # of the ordinary shutter


class AvtRegisters:
    """The advanced registers of a camera.

    Args:
        device: an open camera of any maker.

    Attributes:
        signs: the camera can write a secure image signature.
        extended_shutter: the exposure can be set in microseconds.
    """

    #: In the first pixels of this row: the cycle time of the bus, the counts of frames and of triggers.
    row: Final = -1
    words: Final = 3

    def __init__(self, device: Device) -> None:
        self._device = device
        avt = device.vendor_id == AVT_VENDOR_ID and device.has_advanced_registers
        self._avt = avt
        self.signs = avt and all(self._has(place) for place in (_SIGNATURE, _FRAME_COUNTER, _TRIGGER_COUNTER))
        self.extended_shutter = avt and self._has(_EXTENDED_SHUTTER)

    def sign(self) -> None:
        """Write cycle time, frame and trigger counter into the first pixels of the last line; set both counters to 0.

        In the last line, because any lost packet moves it.
        """
        self._device.write_advanced(_SIGNATURE, _ON | _LAST_LINE)
        for counter in (_FRAME_COUNTER, _TRIGGER_COUNTER):
            self._device.write_advanced(counter, _RESET | _ON | _LAST_LINE)

    def sign_nothing(self) -> None:
        """Switch the signature off: all pixels are picture."""
        for register in (_SIGNATURE, _FRAME_COUNTER, _TRIGGER_COUNTER):
            self._device.write_advanced(register, _LAST_LINE)

    def still_signs(self) -> bool:
        """Whether the signature is still switched on, in the last line."""
        return self._device.read_advanced(_SIGNATURE) & (_ON | _LAST_LINE) == _ON | _LAST_LINE

    def counters(self) -> tuple[int, int]:
        """Frames read out of the sensor, and trigger pulses seen."""
        frames = self._device.read_advanced(_FRAME_COUNTER + _COUNT)
        return frames, self._device.read_advanced(_TRIGGER_COUNTER + _COUNT)

    def set_extended_shutter(self, exposure_us: float) -> None:
        """Set the exposure in microseconds. Any change of format or rate cancels it: call this last."""
        self._device.write_advanced(_EXTENDED_SHUTTER, min(_LONGEST_US, max(1, round(exposure_us))))

    def shutter_steps(self, exposure_us: float, offset_us: float) -> int | None:
        """Value of the ordinary shutter register for an exposure; None if it is out of range or its step unknown."""
        if not (self._avt and self._has(_TIMEBASE)):
            return None
        number = self._device.read_advanced(_TIMEBASE) & 0xF
        if number >= len(_TIMEBASES_US):
            return None
        steps = round((exposure_us - offset_us) / _TIMEBASES_US[number])
        return steps if 1 <= steps <= _SHUTTER_STEPS else None

    def _has(self, register: int) -> bool:
        try:
            return bool(self._device.read_advanced(register) & _PRESENT)
        except Dc1394Error:
            return False  # older firmware answers with an address error: it has no such register
