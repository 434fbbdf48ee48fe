"""Draws a contact sheet of a log: triplets of the jump on one page, as a PNG file."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis.film.whole import whole_file
from analysis.film.words import FONT, write_outlined
from analysis.images.activity import liveliest
from recorder.reading.parts import RecordingReader
from recorder.reading.triplets import StoredTriplet, stored_triplets
from rig.clocks import NS_PER_S
from rig.errors import LogDamagedError
from rig.frame import FrameStatus
from rig.images.picture import shown
from rig.phrase import phrase
from rig.tag import CameraTag
from rig.topics import SESSION_METADATA

_Colour = tuple[int, int, int]

_PAPER: Final[_Colour] = (32, 30, 28)  # blue, green, red
_INK: Final[_Colour] = (235, 235, 235)
_FAINT: Final[_Colour] = (160, 160, 160)
_ALARM: Final[_Colour] = (90, 90, 245)

_MARGIN, _CAPTION, _TITLE = 24, 40, 96
_SHEET_WIDTH = 2400


def write_contact_sheet(log: Path, out: Path, count: int = 12, *, pulses: range | None = None) -> list[int]:
    """Draw `count` triplets, spread over the stretch of the log in which most moves.

    Args:
        log: the log; of a damaged one, the part that can be read.
        out: PNG file, overwritten if it exists.
        count: number of triplets.
        pulses: choose among these; None: among all.

    Returns:
        The pulses shown.

    Raises:
        BadInputError: no such log, or `out` cannot be written.
        StorageError: the disk is full or fails.
        LogDamagedError: the log holds no image.
    """
    with RecordingReader(log) as reader:
        triplets = [each for each in stored_triplets(reader) if pulses is None or each.tag.pulse in pulses]
        if not triplets:
            raise LogDamagedError(
                phrase(
                    "export_no_image",
                    "{log}: holds no image that could be shown; look at it with `svev verify`",
                    log=str(log),
                )
            )
        chosen = liveliest(reader, triplets, count)
        size = _tile_size(triplets[0].tag.shape)
        images = [_shrunk(shown(t.image(reader), t.tag.pixels, coloured=True), size) for t in chosen]
        sheet = _sheet(chosen, images, _title(reader.metadata.get(SESSION_METADATA, {}), triplets))
    _, data = cv2.imencode(".png", sheet)
    with whole_file(out) as part:
        part.write_bytes(data.tobytes())
    return [triplet.tag.pulse for triplet in chosen]


def _across(shape: tuple[int, int]) -> int:
    """How many triplets stand side by side on the sheet: two if they are wide."""
    return 2 if shape[1] >= 2 * shape[0] else 4


def _tile_size(shape: tuple[int, int]) -> tuple[int, int]:
    """Width and height of a triplet on the sheet, px."""
    across = _across(shape)
    width = (_SHEET_WIDTH - _MARGIN * (across + 1)) // across
    return width, max(1, round(width * shape[0] / shape[1]))


def _shrunk(image: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    shrinks = size[0] < image.shape[1]
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    return np.asarray(small, np.uint8)


def _sheet(
    chosen: Sequence[StoredTriplet], images: Sequence[NDArray[np.uint8]], title: tuple[str, str]
) -> NDArray[np.uint8]:
    height, width = images[0].shape[:2]
    across = _across(chosen[0].tag.shape)
    down = -(-len(chosen) // across)
    sheet = np.full((_TITLE + down * (height + _CAPTION + _MARGIN), _SHEET_WIDTH, 3), _PAPER, np.uint8)
    _write(sheet, title[0], (_MARGIN, 40), 1.1, _INK)
    _write(sheet, title[1], (_MARGIN, 72), 0.7, _FAINT)
    start = chosen[0].tag.time
    for place, (triplet, image) in enumerate(zip(chosen, images, strict=True)):
        row, column = place // across, place % across
        x, y = _MARGIN + column * (width + _MARGIN), _TITLE + row * (height + _CAPTION + _MARGIN)
        sheet[y : y + height, x : x + width] = image if image.ndim == 3 else image[:, :, np.newaxis]
        for camera in triplet.tag.cameras:
            _draw_camera(sheet[y : y + height, x : x + width], camera, width / triplet.tag.shape[1])
        seconds = (triplet.tag.time - start) / NS_PER_S
        _write(sheet, f"pulse {triplet.tag.pulse}", (x, y + height + 27), 0.75, _INK)
        _write(sheet, f"+{seconds:.3f} s", (x + 170, y + height + 27), 0.65, _FAINT)
    return sheet


def _draw_camera(tile: NDArray[np.uint8], camera: CameraTag, scale: float) -> None:
    """Write the camera's name on its block, and if the block is black, the reason."""
    left, right = round(camera.columns[0] * scale), round(camera.columns[1] * scale)
    if left:
        cv2.line(tile, (left, 0), (left, tile.shape[0]), _PAPER, 2)
    write_outlined(tile, camera.name, (left + 10, 26), 0.7)
    if camera.status is not FrameStatus.OK:
        word = camera.status.value
        (wide, high), _ = cv2.getTextSize(word, FONT, 1.0, 1)
        _write(tile, word, ((left + right - wide) // 2, (tile.shape[0] + high) // 2), 1.0, _ALARM)


def _title(session: dict[str, str], triplets: Sequence[StoredTriplet]) -> tuple[str, str]:
    """Two lines: who and what; when and how many."""
    first, last = triplets[0].tag, triplets[-1].tag
    who = [session.get("athlete", ""), *(f"{key} {session[key]}" for key in ("bib", "gate") if session.get(key))]
    when = datetime.fromtimestamp(first.time // NS_PER_S, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    return (
        "   ".join(part for part in [f"Recording {first.recording}", *who] if part),
        f"{when}   pulses {first.pulse} to {last.pulse} in {(last.time - first.time) / NS_PER_S:.2f} s",
    )


def _write(image: NDArray[np.uint8], text: str, at: tuple[int, int], size: float, colour: _Colour) -> None:
    cv2.putText(image, text, at, FONT, size, colour, 1, cv2.LINE_AA)
