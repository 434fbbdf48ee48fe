"""Films for tests: every frame is known, so that what a log holds can be compared."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
from av.video.stream import VideoStream
from numpy.typing import NDArray

from rig.images.pixels import Stored

SIZE = (64, 48)


def picture(number: int, size: tuple[int, int] = SIZE, kind: type = np.uint8) -> Stored:
    """A picture that tells its number."""
    return np.random.default_rng(number).integers(0, np.iinfo(kind).max, size[::-1]).astype(kind)


def write_folder(path: Path, numbers: Sequence[int], name: str = "frame_{}.png", **how: object) -> Path:
    """A folder of images, one for each number."""
    path.mkdir()
    for number in numbers:
        cv2.imwrite(str(path / name.format(number)), picture(number, **how))  # type: ignore[arg-type]
    return path


def write_video(
    path: Path,
    frames: Sequence[NDArray[np.generic]],
    *,
    rate: int = 50,
    codec: str = "ffv1",
    given: str = "gray",
    stored: str = "gray",
    ticks: Sequence[int] | None = None,
    metadata: dict[str, str] | None = None,
    options: dict[str, str] | None = None,
) -> Path:
    """A video of these frames; `ticks` are their times in thousandths of a second, otherwise they come evenly.

    `options` are those of the codec.
    """
    with av.open(str(path), "w") as file:
        file.metadata.update(metadata or {})
        stream = file.add_stream(codec, rate=rate, options=options)
        assert isinstance(stream, VideoStream)
        stream.time_base = stream.codec_context.time_base = Fraction(1, 1000)
        stream.width, stream.height, stream.pix_fmt = frames[0].shape[1], frames[0].shape[0], stored
        for place, pixels in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(pixels, format=given)  # type: ignore[arg-type]
            frame.pts = place * 1000 // rate if ticks is None else ticks[place]
            frame.time_base = Fraction(1, 1000)
            file.mux(stream.encode(frame))
        file.mux(stream.encode(None))
    return path
