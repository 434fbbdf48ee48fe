"""Grey values of pictures, image files among them: colour becomes grey, fewer bits become more.

Colour becomes luma by ITU-R BT.601, Y = 0.299 R + 0.587 G + 0.114 B, as OpenCV computes it. A video that holds luma and
chroma has its grey values already: its luma is taken, whatever colours it was made of, and limited range (16 to 235 of
8 bits) is spread over all values.
"""

from functools import cache
from typing import Any, Final

import cv2
import numpy as np
from av import VideoFrame
from numpy.typing import NDArray

from rig.images.pixels import Stored

#: Formats of FFmpeg whose first plane is grey, or luma that stands in two bytes with the lower one first.
_LUMA_FIRST: Final = ("gray", "yuv", "nv")
#: Formats whose only plane holds luma in every other byte, from this one on.
_LUMA_BETWEEN: Final = {"yuyv422": 0, "yvyu422": 0, "uyvy422": 1}
#: `AVCOL_RANGE_JPEG` of FFmpeg: luma takes all values.
_FULL_RANGE: Final = 2


def grey(picture: NDArray[Any]) -> Stored:
    """A picture as an image file holds it, without its colours.

    Args:
        picture: (rows, columns), or (rows, columns, 1 to 4): grey, grey and opacity, or blue, green, red and, perhaps,
            opacity, which is left out.

    Returns:
        uint8 or uint16, (rows, columns), C-contiguous.

    Raises:
        ValueError: there are no such pixels.
    """
    if picture.dtype not in (np.dtype(np.uint8), np.dtype(np.uint16)):
        raise ValueError(f"its pixels are {picture.dtype}, and 8 or 16 bits without sign are taken")
    if picture.ndim == 3 and picture.shape[2] >= 3:
        picture = cv2.cvtColor(np.ascontiguousarray(picture[:, :, :3]), cv2.COLOR_BGR2GRAY)
    elif picture.ndim == 3:
        picture = picture[:, :, 0]
    return np.ascontiguousarray(picture)


def bits_of(frame: VideoFrame) -> int:
    """How many bits a grey value of a frame of a video has: 8, or more than that and at most 16."""
    return min(16, max(8, frame.format.components[0].bits))


def grey_of(frame: VideoFrame) -> Stored:
    """The grey values of a frame of a video.

    Returns:
        uint8 or uint16 with `bits_of(frame)` significant bits, (rows, columns), C-contiguous.
    """
    name, bits = frame.format.name, bits_of(frame)
    whole_numbers = frame.format.components[0].bits <= 16
    every, first = (2, _LUMA_BETWEEN[name]) if name in _LUMA_BETWEEN else (1, 0)
    if not name.startswith((*_LUMA_FIRST, *_LUMA_BETWEEN)) or frame.format.is_big_endian or not whole_numbers:
        return _scaled_from_colours(frame, bits)
    plane = frame.planes[0]
    kind: np.dtype[np.unsignedinteger[Any]] = np.dtype(np.uint8) if bits == 8 else np.dtype("<u2")
    lines: Stored = np.frombuffer(memoryview(plane), kind, plane.line_size // kind.itemsize * plane.height)
    values = lines.reshape(plane.height, -1)[: frame.height, first : every * frame.width : every]
    if name.startswith(("gray", "yuvj")) or frame.color_range == _FULL_RANGE:
        return np.ascontiguousarray(values)
    spread: Stored = _spread(bits)[values & ((1 << bits) - 1)]
    return spread


def widened(picture: Stored, bits: int, wanted: int) -> Stored:
    """The same picture with more bits, white staying white.

    Args:
        picture: uint8 or uint16, of which so many bits are significant.
        bits: how many.
        wanted: at least as many.
    """
    if bits == wanted:
        return picture
    wide = picture.astype(np.uint32) * ((1 << wanted) - 1)
    white = (1 << bits) - 1
    return ((wide + white // 2) // white).astype("<u2")


def _scaled_from_colours(frame: VideoFrame, bits: int) -> Stored:
    if bits == 8:
        return grey(frame.to_ndarray(format="bgr24"))
    blue_green_red = frame.to_ndarray(format="rgb48le")[:, :, ::-1]
    full = grey(np.ascontiguousarray(blue_green_red)).astype(np.uint32)
    white = (1 << bits) - 1
    return ((full * white + 32767) // 65535).astype("<u2")


@cache
def _spread(bits: int) -> Stored:
    """The full range for each value of the limited one (ITU-R BT.601, BT.709: 16 to 235 of 8 bits), rounded."""
    black, white = 16 << (bits - 8), 235 << (bits - 8)
    most = (1 << bits) - 1
    full = np.rint((np.arange(most + 1) - black) * (most / (white - black))).clip(0, most)
    spread: Stored = full.astype(np.uint8 if bits == 8 else np.dtype("<u2"))
    return spread


def decoded(data: NDArray[np.uint8]) -> Stored | None:
    """The grey values of an image file; None if it cannot be read.

    Args:
        data: the file, (bytes,).

    Raises:
        ValueError: its pixels are of a kind that logs do not hold; the text says which.
    """
    try:
        picture: NDArray[Any] | None = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    except cv2.error:
        return None
    return None if picture is None else grey(picture)
