"""Frames of films side by side: the triplets of a log, their tags, and what is to be said of missing frames."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from msgspec import UNSET

from recorder.importing.films import Camera
from recorder.importing.grey import widened
from recorder.importing.source import Taken
from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.images.pixels import Pixels, Stored
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag

SESSION: Final = "imported films"


class FilmTriplets:
    """Puts the frames of a pulse into one triplet.

    Args:
        cameras: left to right.
        pixels: how the log holds grey values.
        recording: its id.

    Attributes:
        shape: rows and columns.
    """

    def __init__(self, cameras: Sequence[Camera], pixels: Pixels, recording: str) -> None:
        self._cameras, self._pixels, self._recording = cameras, pixels, recording
        sizes = [camera.film.size for camera in cameras]
        self.shape = max(height for _, height in sizes), sum(width for width, _ in sizes)
        ends = np.cumsum([0, *(width for width, _ in sizes)]).tolist()
        rows = [UNSET if height == self.shape[0] else height for _, height in sizes]
        self._absent = [
            CameraTag(camera.name, columns, FrameStatus.ABSENT, rows=height)
            for camera, columns, height in zip(cameras, pairwise(ends), rows, strict=True)
        ]
        self._canvas: Stored = np.zeros(self.shape, pixels.dtype)
        self._brightest = [0] * len(cameras)
        self._ended = [False] * len(cameras)
        self.used = {camera.name: 0 for camera in cameras}

    def take(self, pulse: int, time: UtcNs, taken: Sequence[Taken | None]) -> tuple[TripletTag, Stored | None]:
        """The tag of a pulse, and its pixels, valid until the next call; None: no film has a frame there.

        Args:
            pulse: its number in the log.
            time: of it, UTC.
            taken: the frame of each film, None: it has ended.

        Raises:
            BadInputError: a grey value is larger than so many bits hold.
        """
        tags = []
        for place, frame in enumerate(taken):
            absent = self._absent[place]
            block = self._canvas[absent.part]
            if frame is None or frame.pixels is None:
                block.fill(0)
                status = FrameStatus.ABSENT if frame is None else frame.status
                tags.append(CameraTag(absent.name, absent.columns, status, rows=absent.rows))
                continue
            np.copyto(block, self._fitted(place, frame.number, frame.pixels))
            self.used[absent.name] += 1
            tags.append(CameraTag(absent.name, absent.columns, FrameStatus.OK, frame_id=frame.number, rows=absent.rows))
        tag = TripletTag.made(PulseNumber(pulse), time, SESSION, self._recording, self.shape, tuple(tags), self._pixels)
        return tag, self._canvas if any(each.status is FrameStatus.OK for each in tags) else None

    def missing(self, taken: Sequence[Taken | None]) -> list[tuple[str, str]]:
        """What is new of missing frames of a pulse: camera and words; of a film that has ended, only once."""
        found = []
        for place, (camera, frame) in enumerate(zip(self._cameras, taken, strict=True)):
            if frame is None and not self._ended[place]:
                self._ended[place] = True
                found.append((camera.name, f"absent: {camera.film.path.name} has no more frames, others have"))
            elif frame is not None and frame.status is not FrameStatus.OK:
                found.append((camera.name, f"{frame.status.value}: {frame.why}"))
        return found

    def remarks(self) -> list[tuple[str, str]]:
        """What a person should know of the films when all of them have been read: camera and words."""
        found = []
        for camera, brightest in zip(self._cameras, self._brightest, strict=True):
            found += [(camera.name, remark) for remark in camera.film.remarks]
            white = (1 << camera.bits) - 1
            if camera.bits < self._pixels.bits:
                found.append((camera.name, f"its {camera.bits} bits became {self._pixels.bits}; white stays white"))
            if camera.film.bits == camera.bits == 16 and 0 < brightest < white // 2:
                found.append(
                    (camera.name, f"its brightest pixel is {brightest} of {white}: if it gave fewer bits, give --bits")
                )
        return found

    def _fitted(self, place: int, number: int, picture: Stored) -> Stored:
        camera = self._cameras[place]
        if camera.film.bits == 16:
            brightest = int(picture.max())
            self._brightest[place] = max(self._brightest[place], brightest)
            if brightest >= 1 << camera.bits:
                raise BadInputError(
                    f"{camera.film.path}: frame {number} has the grey value {brightest}, more than {camera.bits} bits "
                    "hold: give a larger --bits, or leave it out"
                )
        return widened(picture, camera.bits, self._pixels.bits)
