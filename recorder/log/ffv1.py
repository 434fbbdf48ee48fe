"""Codes pixels without loss by FFV1 (RFC 9043), version 1: every image for itself, by nothing but its own bytes."""

from fractions import Fraction
from typing import Any, Final, Literal

import av
import numpy as np

from rig.images.pixels import Stored

#: Of one bit stream per image: no header is kept elsewhere (version 1), no image needs another one (`g`).
_OPTIONS: Final = {"level": "1", "g": "1"}
#: By bytes of a pixel. Mosaics are coded as they stand, 10 and 12 bits as the 16 that hold them.
_FORMATS: Final = {1: "gray", 2: "gray16le"}
CODEC: Final = "ffv1"


class Encoder:
    """Codes images of one size.

    Args:
        shape: rows and columns.
        size: bytes of a pixel, 1 or 2.
    """

    def __init__(self, shape: tuple[int, int], size: int) -> None:
        self._format = _FORMATS[size]
        self._context = _context("w", shape)
        self._context.pix_fmt = self._format
        self._context.time_base = Fraction(1, 1)
        self._context.options = _OPTIONS

    def __call__(self, pixels: Stored) -> bytes:
        """The pixels, (rows, columns), coded."""
        packets = self._context.encode(av.VideoFrame.from_ndarray(pixels, format=self._format))
        if len(packets) != 1:
            raise RuntimeError(f"FFV1 made {len(packets)} packets of one image")
        return bytes(packets[0])


def decoded(coded: bytes, shape: tuple[int, int], size: int) -> Stored:
    """The pixels of an image, (rows, columns), where the decoder has put them.

    Args:
        coded: what the encoder made of it.
        shape: rows and columns.
        size: bytes of a pixel, 1 or 2.

    Raises:
        ValueError: these bytes are no such image.
    """
    try:
        frames = _context("r", shape).decode(av.Packet(coded))
    except av.FFmpegError as error:
        raise ValueError(f"it is no FFV1 image ({error.strerror})") from None
    if len(frames) != 1 or frames[0].format.name != _FORMATS[size] or (frames[0].height, frames[0].width) != shape:
        raise ValueError("its FFV1 image is of another size or kind")
    plane = frames[0].planes[0]
    kind: np.dtype[np.unsignedinteger[Any]] = np.dtype(np.uint8 if size == 1 else "<u2")
    rows = np.frombuffer(memoryview(plane), kind).reshape(shape[0], plane.line_size // size)
    return rows[:, : shape[1]]


def _context(mode: Literal["r", "w"], shape: tuple[int, int]) -> av.VideoCodecContext:
    context = av.CodecContext.create(CODEC, mode)
    context.height, context.width = shape
    context.thread_count = 1  # more would hold images back, and take cores that a recording needs
    return context
