"""Copies frames out of the kernel's ring: 16-bit pixels get the order of bytes and the place of bits that logs have.

IIDC sends the higher byte first, logs and GigE Vision have the lower one first. Of pixels with 10 or 12 significant
bits, the standard has them at the bottom of the 16 (IIDC 1.31, DATA_DEPTH); AVT has them at the top ("In 16-bit mode
the data output is MSB aligned", Marlin manual V2.7, page 58), and no register says which. The pixels do: no value of
the one kind is above 2**bits - 1, and all values of the other kind are multiples of 2**(16 - bits).
"""

import ctypes
from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rig.settings.camera import CameraSettings

#: Called with the address of a frame and the slot that it goes to, shape (bytes,).
CopyFrame: TypeAlias = Callable[[int, NDArray[np.uint8]], None]

_BITS: Final = 16


def copier(camera: CameraSettings, *, at_top: bool) -> CopyFrame:
    """What copies the frames of a camera.

    Args:
        camera: its settings.
        at_top: whether cameras of its maker have the significant bits of 16 at the top: believed until a frame shows.
    """
    if camera.format.pixels.size > 1:
        return _DeepPixels(camera, at_top)
    return _copy_bytes


def _copy_bytes(address: int, slot: NDArray[np.uint8]) -> None:
    ctypes.memmove(slot.ctypes.data, address, slot.nbytes)


class _DeepPixels:
    """Copies frames of 16-bit pixels, in one pass."""

    def __init__(self, camera: CameraSettings, at_top: bool) -> None:
        self._unused = _BITS - camera.format.pixels.bits
        self._count = camera.region.width * camera.region.height
        self._picture = self._count - camera.region.width  # the last line may hold the signature
        self._at_top, self._shown = at_top and self._unused > 0, self._unused == 0

    def __call__(self, address: int, slot: NDArray[np.uint8]) -> None:
        """Copy a frame."""
        sent = np.frombuffer(memoryview((ctypes.c_uint16 * self._count).from_address(address)), ">u2")
        if not self._shown:
            self._look(int(np.bitwise_or.reduce(sent[: self._picture])))
        out = slot.view("<u2")
        if self._at_top:
            np.right_shift(sent, self._unused, out=out)
        else:
            np.copyto(out, sent)

    def _look(self, used: int) -> None:
        """Learn from the bits that are set in any pixel of a frame where the significant ones are."""
        top, bottom = used >> (_BITS - self._unused), used & (1 << self._unused) - 1
        if top or bottom:
            self._at_top, self._shown = bool(top), True
