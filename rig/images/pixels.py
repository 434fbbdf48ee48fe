"""What pixels are: as cameras send them (`FORMATS`), and as triplets, logs and messages hold them (`Pixels`)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

#: Pixels as they are stored, uint8 or uint16, (rows, columns).
Stored: TypeAlias = NDArray[np.unsignedinteger[Any]]

PixelFormatName = Literal[
    "Mono8", "Mono10", "Mono12", "Mono16", "Mono10Packed", "Mono12Packed", "Mono10p", "Mono12p",
    "BayerRG8", "BayerGR8", "BayerGB8", "BayerBG8",
]  # fmt: skip

#: Encodings of `foxglove.RawImage` that hold one byte per pixel; `mono16` holds two, the lower one first.
_OF_BYTES: Final = frozenset({"mono8", "bayer_rggb8", "bayer_grbg8", "bayer_gbrg8", "bayer_bggr8"})


@dataclass(frozen=True, slots=True)
class Pixels:
    """How a triplet holds its pixels.

    Attributes:
        encoding: name in `foxglove.RawImage`.
        bits: how many bits of a pixel are significant, the lowest ones: white is 2**bits - 1.

    Raises:
        ValueError: there are no such pixels.
    """

    encoding: str = "mono8"
    bits: int = 8

    def __post_init__(self) -> None:
        """Check that encoding and bits belong together."""
        known = 8 < self.bits <= 16 if self.encoding == "mono16" else self.encoding in _OF_BYTES and self.bits == 8
        if not known:
            raise ValueError(f'no pixels of ours: "{self.encoding}" with {self.bits} significant bits')

    @property
    def size(self) -> int:
        """Bytes of one pixel."""
        return 2 if self.bits > 8 else 1

    @property
    def dtype(self) -> "np.dtype[np.unsignedinteger[Any]]":
        """Type of a pixel in numpy."""
        return np.dtype("<u2") if self.bits > 8 else np.dtype(np.uint8)

    @property
    def is_mosaic(self) -> bool:
        """Whether each pixel has one of three colours (Bayer)."""
        return self.encoding.startswith("bayer_")

    @property
    def scale(self) -> float:
        """Values per grey level of eight bits."""
        return float(1 << (self.bits - 8))


MONO8: Final = Pixels()


@dataclass(frozen=True, slots=True)
class PixelFormat:
    """How a camera sends its pixels (EMVA: Pixel Format Naming Convention 2.4; GigE Vision 2.0, section 27).

    Attributes:
        code: number of the format in GigE Vision; its third byte is the number of bits of a pixel.
        group: so many pixels, side by side, stand together in whole bytes.
        pixels: as they are stored.
    """

    code: int
    group: int
    pixels: Pixels

    def frame_bytes(self, width: int, height: int) -> int:
        """Bytes of a frame as the camera sends it."""
        return width * height * (self.code >> 16 & 0xFF) // 8


_TEN, _TWELVE = Pixels("mono16", 10), Pixels("mono16", 12)
FORMATS: Final[Mapping[str, PixelFormat]] = {
    "Mono8": PixelFormat(0x01080001, 1, MONO8),
    "Mono10": PixelFormat(0x01100003, 1, _TEN),
    "Mono12": PixelFormat(0x01100005, 1, _TWELVE),
    "Mono16": PixelFormat(0x01100007, 1, Pixels("mono16", 16)),
    "Mono10Packed": PixelFormat(0x010C0004, 2, _TEN),
    "Mono12Packed": PixelFormat(0x010C0006, 2, _TWELVE),
    "Mono10p": PixelFormat(0x010A0046, 4, _TEN),
    "Mono12p": PixelFormat(0x010C0047, 2, _TWELVE),
    "BayerGR8": PixelFormat(0x01080008, 2, Pixels("bayer_grbg8")),
    "BayerRG8": PixelFormat(0x01080009, 2, Pixels("bayer_rggb8")),
    "BayerGB8": PixelFormat(0x0108000A, 2, Pixels("bayer_gbrg8")),
    "BayerBG8": PixelFormat(0x0108000B, 2, Pixels("bayer_bggr8")),
}
