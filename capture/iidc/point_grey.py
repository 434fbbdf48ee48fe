"""What Point Grey's cameras can do beyond the standard: write time and number of a frame into its first pixels.

Source: Point Grey, technical application note TAN2008011 and register reference, register FRAME_INFO. Bits are counted
from the most significant one; bit 0 says whether the camera has the register. Which information a model has, a write
that is read back says. No camera has confirmed this.
"""

from typing import Final

from capture.iidc.device import Device
from capture.iidc.library import Dc1394Error

POINT_GREY_VENDOR_ID: Final = 0x00B09D

_FRAME_INFO: Final = 0x12F8  # from the start of the command registers
_PRESENT, _FRAME_COUNTER, _TIME = 0x8000_0000, 1 << (31 - 25), 1 << (31 - 31)
_INSERTED: Final = _FRAME_COUNTER | _TIME


class PointGreyRegisters:
    """The frame information of a camera.

    Args:
        device: an open camera of any maker.

    Attributes:
        signs: the camera can write time and number of a frame into it.
    """

    #: In the first pixels of this row: the cycle time of the bus, the count of frames.
    row: Final = 0
    words: Final = 2

    def __init__(self, device: Device) -> None:
        self._device = device
        self.signs = device.vendor_id == POINT_GREY_VENDOR_ID and self._takes()

    def sign(self) -> None:
        """Write time and number of each frame into its first pixels."""
        self._device.write_command(_FRAME_INFO, _PRESENT | _INSERTED)

    def sign_nothing(self) -> None:
        """All pixels are picture."""
        self._device.write_command(_FRAME_INFO, _PRESENT)

    def still_signs(self) -> bool:
        """Whether time and number, and nothing else, are written into the frames."""
        return self._device.read_command(_FRAME_INFO) & 0x3FF == _INSERTED

    def _takes(self) -> bool:
        """Whether the camera has the register and both kinds of information; its setting stays as it was."""
        try:
            before = self._device.read_command(_FRAME_INFO)
            if not before & _PRESENT:
                return False
            self.sign()
            takes = self.still_signs()
            self._device.write_command(_FRAME_INFO, before)
        except Dc1394Error:
            return False  # older firmware answers with an address error: it has no such register
        return takes
