"""Exports a recording: a video, a folder of pictures, a table or a contact sheet; each whole or not at all."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from analysis.film.contact_sheet import write_contact_sheet
from analysis.film.shots import Recording, Shot
from analysis.film.tag_table import write_tag_table
from analysis.film.video_file import FFV1, VideoFile, h264
from analysis.film.whole import whole_file, whole_folder
from analysis.film.words import caption, write_caption, write_lacking
from rig.api.export import ENDINGS, ExportOrder, Kind, Quality
from rig.images.pixels import Stored

#: Told how many pulses are done, and of how many.
Progress = Callable[[int, int], None]

#: x264's measure of quality.
_CRF: Final = {Quality.SMALL: 28, Quality.GOOD: 21, Quality.BEST: 14}
#: Decoders of phones take no wider pictures; wider ones of several cameras are made smaller, one camera never is.
_WIDEST_PX: Final = 4096
_US_PER_NS: Final = 1e-3
TABLE: Final = "tags.csv"
#: Endings of single pictures, with OpenCV's settings: little compression is fast, and noise hardly shrinks further.
_PICTURES: Final = {
    Kind.PNG: (".png", [cv2.IMWRITE_PNG_COMPRESSION, 1]),
    Kind.TIFF: (".tif", [cv2.IMWRITE_TIFF_COMPRESSION, cv2.IMWRITE_TIFF_COMPRESSION_LZW]),
}


def export(log: Path, order: ExportOrder, out: Path, progress: Progress | None = None) -> int:
    """Export a recording.

    Args:
        log: the log; it is only read. Of a damaged one, the part that can be read.
        order: what of it, and how.
        out: the file, replaced if there is one, or the folder, which must not hold anything; under this name there is
            never half of it.
        progress: told how far it is.

    Returns:
        The number of pulses exported.

    Raises:
        BadInputError: the log cannot be read or has not what is asked for, or `out` cannot be written.
        LogDamagedError: the log has nothing that could be exported.
        StorageError: the disk is full or fails.
    """
    tell = progress or (lambda _done, _all: None)
    recording = Recording(log, order)
    match order.kind:
        case Kind.H264 | Kind.FFV1:
            with whole_file(out) as part:
                _write_video(recording, order, part, tell)
        case Kind.PNG | Kind.TIFF:
            with whole_folder(out) as part:
                _write_pictures(recording, order.kind, part, tell)
                write_tag_table(recording, part / TABLE)
        case Kind.CSV:
            with whole_file(out) as part:
                write_tag_table(recording, part)
        case Kind.CONTACT_SHEET:
            return len(write_contact_sheet(log, out, pulses=recording.pulses))
    return len(recording.pulses)


def in_file_name(camera: str) -> str:
    """The name of a camera as part of the name of a file; our own are, but a log may come from anywhere."""
    return re.sub(r"[^\w.-]|^\.", "_", camera)


def _write_video(recording: Recording, order: ExportOrder, out: Path, tell: Progress) -> None:
    """One picture a pulse, at the time of the pulse, slowed down."""
    lossless = order.kind is Kind.FFV1
    video: VideoFile | None = None
    start = recording.time_of(recording.pulses[0])
    try:
        for done, shot in enumerate(recording.shots(), 1):
            picture = _picture(recording, shot, order)
            if video is None:
                codec = FFV1 if lossless else h264(_CRF[order.quality])
                video = VideoFile(out, ENDINGS[order.kind], picture, recording.rate_hz / order.slow, codec)
            video.add(picture, round((shot.time - start) * _US_PER_NS * order.slow))
            tell(done, len(recording.pulses))
        if video is not None:
            video.finish()
    finally:
        if video is not None:
            video.close()


def _picture(recording: Recording, shot: Shot, order: ExportOrder) -> Stored:
    """The picture of a pulse; without loss, only pulses that the log does not know have words, unless asked for."""
    picture, columns = shot.image, recording.columns
    if order.kind is not Kind.FFV1 and len(columns) > 1 and picture.shape[1] > _WIDEST_PX:
        scale = _WIDEST_PX / picture.shape[1]
        size = (_WIDEST_PX, max(2, round(picture.shape[0] * scale)))
        picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), picture.dtype)
        columns = tuple((round(first * scale), round(end * scale)) for first, end in columns)
    named = bool(shot.lacking) and (order.kind is not Kind.FFV1 or shot.tag is None or order.burn_in)
    if not named and not order.burn_in:
        return picture
    picture = picture.copy()
    if named:
        write_lacking(picture, shot, columns, order.language)
    if order.burn_in:
        write_caption(picture, caption(shot, recording.session, order.language))
    return picture


def _write_pictures(recording: Recording, kind: Kind, folder: Path, tell: Progress) -> None:
    """A folder for each camera, with the frames that came; their names are sorted by pulse."""
    ending, settings = _PICTURES[kind]
    digits = max(6, len(str(recording.pulses[-1])))
    names = [in_file_name(name) for name in recording.cameras]
    for name in names:
        (folder / name).mkdir()
    for done, shot in enumerate(recording.shots(), 1):
        for place, (first, end) in enumerate(recording.columns):
            if place not in shot.lacking:
                block = np.ascontiguousarray(shot.image[: recording.rows[place], first:end])
                _, data = cv2.imencode(ending, block, settings)
                file = folder / names[place] / f"{names[place]}_{shot.pulse:0{digits}d}{ending}"
                file.write_bytes(data.tobytes())
        tell(done, len(recording.pulses))
