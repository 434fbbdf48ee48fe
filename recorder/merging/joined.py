"""Tags and pictures of the cameras of two logs side by side: those of the first, then those of the second."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
from msgspec import UNSET, UnsetType
from msgspec.structs import replace

from recorder.merging.source import Part, Pulse
from rig.clocks import NS_PER_US, UtcNs
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.images.pixels import Pixels, Stored
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag
from triggering.alignment import Alignment

#: A triplet has at most so many cameras.
_CAMERAS_MAX: Final = 8


class JoinedTriplets:
    """Makes the triplets of two logs' cameras.

    Args:
        first: its cameras stand on the left, and its line of time is that of the result.
        second: the other log.
        alignment: which pulses are the same.
        recording: id of the new log.

    Attributes:
        shape: rows and columns.
        kind: how the pixels are held.
        cameras: name and columns of each camera, left to right.

    Raises:
        BadInputError: the cameras cannot stand in one triplet.
    """

    def __init__(self, first: Part, second: Part, alignment: Alignment, recording: str) -> None:
        check_fit(first, second)
        self._parts, self._alignment = (first, second), alignment
        self._session, self._recording = first.first.session or second.first.session, recording
        self.kind: Pixels = first.first.pixels
        rows, columns = zip(first.first.shape, second.first.shape, strict=True)
        self.shape = max(rows), sum(columns)
        self._places = (0, columns[0])
        self._canvas: Stored = np.zeros(self.shape, self.kind.dtype)
        self._absent = tuple(
            tuple(
                CameraTag(camera.name, self._columns(camera, side), FrameStatus.ABSENT, rows=self._rows(camera, side))
                for camera in part.first.cameras
            )
            for side, part in enumerate(self._parts)
        )
        self.cameras = [(camera.name, camera.columns) for cameras in self._absent for camera in cameras]

    def tag(self, number: int, one: Pulse | None, two: Pulse | None) -> TripletTag:
        """The tag of a pulse that at least one log has."""
        if one is not None:
            time = one.tag.time
        elif two is not None:
            time = UtcNs(self._alignment.mapped(two.tag.time))
        else:
            raise ValueError("a pulse that no log has")
        left, right = self._absent
        if one is not None:
            left = tuple(self._placed(camera, 0) for camera in one.tag.cameras)
        if two is not None:
            right = tuple(self._moved(camera, two.tag, time) for camera in two.tag.cameras)
        return TripletTag.made(
            PulseNumber(number), time, self._session, self._recording, self.shape, (*left, *right), self.kind
        )

    def picture(self, one: Pulse | None, two: Pulse | None) -> Stored | None:
        """The pixels of a pulse, (rows, columns), valid until the next call; None: no log has any."""
        found = [None if pulse is None else pulse.picture for pulse in (one, two)]
        if all(picture is None for picture in found):
            return None
        for place, part, picture in zip(self._places, self._parts, found, strict=True):
            rows, columns = part.first.shape
            block = self._canvas[:rows, place : place + columns]
            if picture is None:
                block.fill(0)
            else:
                np.copyto(block, picture)
        return self._canvas

    def ready(self, one: Pulse | None, two: Pulse | None) -> UtcNs:
        """When the pulse was ready in both logs."""
        times = [] if one is None else [one.ready]
        times += [] if two is None else [UtcNs(self._alignment.mapped(two.ready))]
        return max(times)

    def _placed(self, camera: CameraTag, side: int) -> CameraTag:
        stamped = camera.stamped
        if stamped is not UNSET:
            stamped = stamped[0], stamped[1] + self._places[side], stamped[2]
        return replace(camera, columns=self._columns(camera, side), rows=self._rows(camera, side), stamped=stamped)

    def _moved(self, camera: CameraTag, tag: TripletTag, time: UtcNs) -> CameraTag:
        """A camera of the second log, its times on the line of the first."""
        placed = self._placed(camera, 1)
        host, offset = placed.host_time, placed.offset_us
        later_us = (self._alignment.mapped(tag.time) - time) / NS_PER_US
        return replace(
            placed,
            host_time=None if host is None else UtcNs(self._alignment.mapped(host)),
            offset_us=None if offset is None else offset + later_us,
        )

    def _columns(self, camera: CameraTag, side: int) -> tuple[int, int]:
        return camera.columns[0] + self._places[side], camera.columns[1] + self._places[side]

    def _rows(self, camera: CameraTag, side: int) -> int | UnsetType:
        rows = self._parts[side].first.shape[0] if camera.rows is UNSET else camera.rows
        return UNSET if rows == self.shape[0] else rows


def check_fit(first: Part, second: Part) -> None:
    """Check that the cameras of two logs can stand in one triplet.

    Raises:
        BadInputError: they have names in common, are too many, or their pixels are held in different ways.
    """
    names = [[camera.name for camera in part.first.cameras] for part in (first, second)]
    both = sorted(set(names[0]) & set(names[1]))
    if both:
        raise BadInputError(
            f"{first.path} and {second.path} both have a camera {both[0]}: merge logs of different cameras; give each "
            "camera of both rig files a name of its own before the next recording"
        )
    if len(names[0]) + len(names[1]) > _CAMERAS_MAX:
        raise BadInputError(
            f"{first.path} and {second.path} have {len(names[0]) + len(names[1])} cameras together: a log takes "
            f"{_CAMERAS_MAX} at most; merge logs with fewer"
        )
    kinds: Mapping[Path, Pixels] = {part.path: part.first.pixels for part in (first, second)}
    if len(set(kinds.values())) > 1:
        told = " and ".join(f"{kind.encoding} of {kind.bits} bits in {path}" for path, kind in kinds.items())
        raise BadInputError(f"pixels are {told}: set the same pixel_format in both rig files before the next recording")
