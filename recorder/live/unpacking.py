"""Copies a frame from the camera's ring into the triplet, and unpacks its pixels on the way.

Aravis writes what the camera sends straight into the ring, so pixels of 10 and 12 bits may stand there packed: several
in whole bytes. They become numbers of 16 bits in the one copy that every frame goes through; nothing is allocated for
it but views.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rig.images.pixels import Stored
from rig.settings.camera import CameraSettings

#: Called with the bytes of a frame as the camera sent it, and its place in the triplet, (rows, columns).
Unpack: TypeAlias = Callable[[NDArray[np.uint8], Stored], None]

#: Pixels that are unpacked at a time; with their bytes and what is computed they stay in the processor's cache.
_STRIP_PX: Final = 16 << 10


@dataclass(frozen=True, slots=True)
class _Layout:
    """How the bytes of a group of pixels, read as one number, the lowest byte first, become pixels of 16 bits.

    Attributes:
        group: pixels of a group; they fill one word of `dtype`, the first pixel in the lowest bits.
        size: bytes of a group.
        moves: by how many bits to the left the number is shifted, and which bits of the word come from it.
    """

    group: int
    size: int
    moves: tuple[tuple[int, int], ...]

    @property
    def dtype(self) -> "np.dtype[np.unsignedinteger[Any]]":
        """Type of a word."""
        return np.dtype(f"<u{2 * self.group}")


#: Mono10p and Mono12p are one stream of bits (PFNC 2.4, section 6.2). In Mono10Packed and Mono12Packed (GigE Vision
#: 2.0, section 27) two pixels stand in three bytes: high bits of the first, low bits of both, high bits of the second.
_PACKED: Final = {
    "Mono10p": _Layout(4, 5, tuple((6 * place, 0x3FF << 16 * place) for place in range(4))),
    "Mono12p": _Layout(2, 3, ((0, 0xFFF), (4, 0xFFF << 16))),
    "Mono10Packed": _Layout(2, 3, ((2, 0x3FC | 0x3FC << 16), (-8, 0x3), (4, 0x3 << 16))),
    "Mono12Packed": _Layout(2, 3, ((4, 0xFF0 | 0xFFF << 16), (-8, 0xF))),
}


def unpacker(camera: CameraSettings) -> Unpack:
    """What copies the frames of a camera."""
    shape, layout = (camera.region.height, camera.region.width), _PACKED.get(camera.pixel_format)
    if layout is not None:
        return _Unpacker(layout, shape)
    dtype = camera.format.pixels.dtype
    return lambda frame, out: np.copyto(out, frame.view(dtype).reshape(shape))


class _Unpacker:
    """Unpacks frames of (rows, columns), some lines at a time."""

    def __init__(self, layout: _Layout, shape: tuple[int, int]) -> None:
        self._layout, (rows, columns) = layout, shape
        self._strip, self._across = max(1, min(rows, _STRIP_PX // columns)), columns // layout.group
        self._packed, self._word, self._part = np.empty((3, self._strip * self._across), layout.dtype)
        kind = layout.dtype.type
        self._moves = [(_shift(shift), kind(abs(shift)), kind(mask)) for shift, mask in layout.moves]

    def __call__(self, frame: NDArray[np.uint8], out: Stored) -> None:
        """Unpack a frame."""
        for first in range(0, len(out), self._strip):
            part = out[first : first + self._strip]
            count = len(part) * self._across
            self._read(frame, first * self._across, count)
            self._move(self._packed[:count], self._word[:count], self._part[:count])
            np.copyto(part.view(self._layout.dtype), self._word[:count].reshape(len(part), -1))

    def _read(self, frame: NDArray[np.uint8], first: int, count: int) -> None:
        """Read groups as numbers, each with the bytes behind it; there are none behind the last of the frame."""
        size, dtype = self._layout.size, self._layout.dtype
        start = first * size
        ends = start + count * size == len(frame)
        whole = count - ends
        np.copyto(self._packed[:whole], np.ndarray((whole,), dtype, frame.data, start, (size,)))
        if ends:
            self._packed[whole] = int.from_bytes(frame[-size:].tobytes(), "little")

    def _move(self, packed: NDArray[Any], word: NDArray[Any], part: NDArray[Any]) -> None:
        for place, (move, shift, mask) in enumerate(self._moves):
            into = part if place else word
            np.bitwise_and(move(packed, shift, out=into), mask, out=into)
            if place:
                np.bitwise_or(word, part, out=word)


def _shift(by: int) -> "np.ufunc":
    return np.left_shift if by > 0 else np.right_shift
