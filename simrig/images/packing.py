"""Packs pixels into the bytes that a camera sends, and puts a colour filter before its sensor.

Written from the layouts of the standards, pixel for pixel, and not from the program that unpacks them.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.images.pixels import FORMATS, Stored

#: What the filters of a sensor let through, of blue, green and red, 1/256; a grey hill is not grey behind them.
_THROUGH: Final = {"B": 205, "G": 256, "R": 179}


class Packing:
    """Packs frames in one pixel format.

    Args:
        name: of the format, as in rig files.
    """

    def __init__(self, name: str) -> None:
        self._name, self._format = name, FORMATS[name]

    def pack(self, frame: Stored, out: NDArray[np.uint8]) -> None:
        """Write a frame, (rows, columns), as bytes."""
        match self._name:
            case "Mono10Packed" | "Mono12Packed":
                low = self._format.pixels.bits - 8
                first, second = (frame[:, place::2].ravel().astype(np.uint32) for place in (0, 1))
                rest = (1 << low) - 1
                out[0::3], out[1::3], out[2::3] = first >> low, first & rest | (second & rest) << 4, second >> low
            case "Mono10p" | "Mono12p":
                self._stream(frame, out)
            case _ if self._format.pixels.is_mosaic:
                np.copyto(out.reshape(frame.shape), self._filtered(frame))
            case _:
                out[...] = frame.astype(frame.dtype.newbyteorder("<")).view(np.uint8).ravel()

    def _stream(self, frame: Stored, out: NDArray[np.uint8]) -> None:
        """One stream of bits, the lowest of each pixel first, filled into bytes from their lowest bit on."""
        bits = np.unpackbits(frame.astype("<u2").view(np.uint8).reshape(-1, 2), axis=1, bitorder="little")
        out[...] = np.packbits(bits[:, : self._format.pixels.bits].ravel(), bitorder="little")

    def _filtered(self, frame: Stored) -> Stored:
        """The frame behind its colour filters; the stamp in its last line goes past them."""
        seen = frame.copy()
        for place, colour in enumerate(self._format.pixels.encoding.removeprefix("bayer_")[:4].upper()):
            row, column = divmod(place, 2)
            part = frame[row::2, column::2].astype(np.uint16) * _THROUGH[colour] >> 8
            seen[row::2, column::2] = part
        seen[-1, -16:] = frame[-1, -16:]
        return seen
