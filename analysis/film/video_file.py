"""Encodes pictures into a video file: H.264 or VP9 for people, FFV1 without loss for programs.

Each picture stands at a time of its own, to a microsecond in MP4, to a millisecond in WebM and Matroska.
"""

from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO, Final

import av
import numpy as np
from av.error import FFmpegError
from av.video.reformatter import ColorRange, Colorspace
from av.video.stream import VideoStream
from numpy.typing import NDArray

#: Grey (rows, columns), also of 16 bits, or blue, green, red (rows, columns, 3).
Picture = NDArray[np.unsignedinteger[Any]]

_TIME_BASE: Final = Fraction(1, 1_000_000)
_BT709, _SRGB = 1, 13  # ITU-T H.273, tables 2 and 3: primaries, and transfer characteristics
_CONTAINERS: Final[Mapping[str, str]] = {".mp4": "mp4", ".mkv": "matroska", ".webm": "webm"}
#: Of files that can be written.
ENDINGS: Final = tuple(_CONTAINERS)
#: Names of pixel formats in FFmpeg, of pictures with so many dimensions and bytes per number.
_GIVEN: Final[Mapping[tuple[int, int], str]] = {(2, 1): "gray", (2, 2): "gray16le", (3, 1): "bgr24"}


@dataclass(frozen=True, slots=True)
class Codec:
    """How pictures are encoded.

    Attributes:
        name: of the encoder in FFmpeg.
        pixels: pixel format that is stored, by that of the pictures.
        options: of the encoder.
        halved: colours are stored for two by two pixels, so that rows and columns have to be even.
    """

    name: str
    pixels: Mapping[str, str] = field(default_factory=lambda: {"gray": "yuv420p", "bgr24": "yuv420p"})
    options: Mapping[str, str] = field(default_factory=dict)
    halved: bool = True


VP9: Final = Codec("libvpx-vp9", options={"crf": "28", "b": "0", "deadline": "realtime", "cpu-used": "6", "g": "30"})
#: Every picture for itself, with a checksum, so that damage stays small and is found.
FFV1: Final = Codec(
    "ffv1",
    {"gray": "gray", "gray16le": "gray16le", "bgr24": "bgr0"},
    {"level": "3", "slicecrc": "1", "g": "1"},
    halved=False,
)


def h264(crf: int) -> Codec:
    """H.264; `crf` from 0, the best, to 51. Two key pictures a second, so that one can scrub."""
    return Codec("libx264", options={"crf": str(crf), "preset": "veryfast", "g": "15"})


class VideoFile:
    """One video file in the making.

    Args:
        out: the file.
        ending: .mp4, .mkv or .webm; chooses the container.
        first: a picture as all will be.
        rate_hz: pictures per second, about.
        codec: how they are encoded. Of an odd number of rows or columns one is left out if colours are halved.
    """

    def __init__(self, out: Path, ending: str, first: Picture, rate_hz: float, codec: Codec) -> None:
        rows, columns = first.shape[:2]
        self._size = (columns // 2 * 2, rows // 2 * 2) if codec.halved else (columns, rows)
        self._given = _GIVEN[first.ndim, first.itemsize]
        options = {"video_track_timescale": str(_TIME_BASE.denominator)} if ending == ".mp4" else {}
        self._on_disk: BinaryIO = out.open("wb")  # Python's own file: errors of the disk are never lost
        try:
            self._file = av.open(self._on_disk, "w", format=_CONTAINERS[ending], options=options)
        except BaseException:
            self._on_disk.close()
            raise
        rate = Fraction(rate_hz).limit_denominator(1000)
        stream = self._file.add_stream(codec.name, rate=rate, options=dict(codec.options))
        if not isinstance(stream, VideoStream):
            raise TypeError(f"{codec.name} makes no video")
        stream.width, stream.height = self._size
        stream.pix_fmt = codec.pixels[self._given]
        stream.time_base = stream.codec_context.time_base = _TIME_BASE
        self._coloured = codec.halved
        if self._coloured:  # without these every player guesses, and grey values differ
            context = stream.codec_context
            context.color_range, context.colorspace = ColorRange.MPEG, Colorspace.ITU709
            context.color_primaries, context.color_trc = _BT709, _SRGB
        self._stream = stream
        self._last_us = -1
        self._finished = False

    def add(self, picture: Picture, at_us: int) -> None:
        """Append a picture at a time, us; at least 1 us after the one before."""
        self._last_us = max(at_us, self._last_us + 1)
        picture = np.ascontiguousarray(picture[: self._size[1], : self._size[0]])
        frame = av.VideoFrame.from_ndarray(picture, format=self._given)
        if self._coloured:
            frame = frame.reformat(
                format=self._stream.pix_fmt, dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG
            )
        frame.pts, frame.time_base = self._last_us, _TIME_BASE
        self._file.mux(self._stream.encode(frame))

    def finish(self) -> None:
        """Write what the encoder still holds, and the end of the file."""
        self._file.mux(self._stream.encode(None))
        self._file.close()
        self._on_disk.flush()
        self._finished = True

    def close(self) -> None:
        """Close the file, finished or not; of one that is not, nothing is told: what stopped it has been."""
        with ExitStack() as stack:
            if not self._finished:
                stack.enter_context(suppress(FFmpegError, OSError))
            stack.callback(self._on_disk.close)
            self._file.close()
