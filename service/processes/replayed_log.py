"""Reads a recorded log for the back end "replay", and checks that a rig file fits the log."""

import os
from array import array
from collections.abc import Iterator, Sequence
from itertools import islice, pairwise
from pathlib import Path
from statistics import median
from typing import Final

import numpy as np

from recorder.reading.items import Chunk
from recorder.reading.log_reader import UNREADABLE, LogReader
from recorder.reading.triplets import images_of, pixels, tag_of, view_image
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import BadInputError, CameraError
from rig.host.files import open_regular
from rig.images.pixels import FORMATS, Stored
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings
from rig.tag import CameraTag, TripletTag
from rig.topics import TAG

#: The kernel fetches frames this number of pulses ahead, so that a busy disk delays none.
_FETCH_AHEAD: Final = 8
#: Number of pulses from which the rate of a log is measured; the rig file's rate may differ by the share below.
_RATE_PULSES: Final = 64
_RATE_TOLERANCE: Final = 0.02


class ReplayedLog:
    """One camera of a log; implements `capture.replay.timeline.FrameSource`.

    The constructor reads all tags; `read_into` reads the pixels of one pulse.

    Args:
        rig: the rig.
        index: index of the camera.

    Raises:
        BadInputError: the file is missing or is not a log, holds no pulse, or has no such camera.
    """

    def __init__(self, rig: RigSettings, index: int) -> None:
        camera = rig.cameras[index]
        self.name = camera.address
        self.times: list[UtcNs] = []
        self.tags: list[CameraTag] = []
        self._offsets, self._lengths = array("Q"), array("Q")
        self._reader = LogReader(Path(camera.address), skim=True)
        self._fd = -1
        try:
            for tag, chunk in _pulses(self._reader):
                self.times.append(tag.time)
                self.tags.append(_camera_of(tag, camera))
                self._offsets.append(chunk.offset)
                self._lengths.append(chunk.length)
            self._fd = open_regular(Path(camera.address), links=True)
        except BaseException:
            self.close()
            raise
        self.period_ns = _period_ns(self.times) or rig.trigger.period_ns

    def read_into(self, out: Stored, place: int) -> bool:
        """Read the pixels of a pulse, as `capture.replay.timeline.FrameSource.read_into` says."""
        ahead = (place + _FETCH_AHEAD) % len(self._offsets)
        os.posix_fadvise(self._fd, self._offsets[ahead], self._lengths[ahead], os.POSIX_FADV_WILLNEED)
        try:
            chunk = self._reader.chunk(self._offsets[place], self._lengths[place])
            image = next(iter(images_of(chunk).values()), None)
            if chunk.flaw or image is None or image.data is None:
                return False
            np.copyto(out, pixels(view_image(image.data))[self.tags[place].part], casting="no")
        except BadInputError as error:
            raise CameraError(str(error)) from None
        except UNREADABLE:  # the chunk holds something else, or frames of another size
            return False
        return True

    def close(self) -> None:
        """Close the file."""
        self._reader.close()
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


def check_replay(rig: RigSettings) -> None:
    """Check that a log has the cameras of the rig that replay it, with the region and rate of the rig file.

    Raises:
        BadInputError: the file is missing or is not a log; it has no such camera, or frames of another size; it was
            recorded at another rate. The message says what to write into the rig file.
    """
    for camera in rig.cameras:
        if camera.backend != "replay":
            continue
        with LogReader(Path(camera.address), skim=True) as reader:
            tags = [tag for tag, _ in islice(_pulses(reader), _RATE_PULSES)]
        columns, rows = _camera_of(tags[0], camera).size(tags[0].shape)
        if (rows, columns) != (camera.region.height, camera.region.width):
            raise BadInputError(
                f"camera {camera.name}: its frames in {camera.address} are {columns} x {rows}, "
                f"the rig file's region is {camera.region.width} x {camera.region.height}: "
                f"write region = {{ width = {columns}, height = {rows} }}"
            )
        held = tags[0].pixels
        whole = (
            name for name, each in FORMATS.items() if each.pixels == held and each.frame_bytes(2, 2) == 4 * held.size
        )
        if camera.pixel_format != (written := next(whole, camera.pixel_format)):
            raise BadInputError(
                f"camera {camera.name}: {camera.address} holds its frames as {held.encoding} with {held.bits} bits, "
                f'the rig file says {camera.pixel_format}: write pixel_format = "{written}"'
            )
        period_ns = _period_ns([tag.time for tag in tags])
        if period_ns is not None and abs(rig.trigger.period_ns / period_ns - 1) > _RATE_TOLERANCE:
            rate = f"{NS_PER_S / period_ns:.2f}".rstrip("0").rstrip(".")
            raise BadInputError(
                f"{camera.address}: was recorded at {rate} pulses per second, trigger.rate_hz is "
                f"{rig.trigger.rate_hz:g}: write rate_hz = {rate}"
            )


def _pulses(reader: LogReader) -> Iterator[tuple[TripletTag, Chunk]]:
    """The pulses of a log in the order of time, each with its chunk; reads no pixels.

    Leaves out what is damaged, comes twice or is out of order.

    Raises:
        BadInputError: the log holds no pulse.
    """
    last = 0
    for chunk in reader.sound_chunks(only=(TAG.name,)):
        for message in chunk.messages:
            tag = tag_of(message)
            if tag is not None and tag.time > last:
                yield tag, chunk
                last = tag.time
    if not last:
        raise BadInputError(f"{reader.path}: holds no pulse; replay another log")


def _camera_of(tag: TripletTag, camera: CameraSettings) -> CameraTag:
    for found in tag.cameras:
        if found.name == camera.name:
            return found
    names = ", ".join(found.name for found in tag.cameras)
    raise BadInputError(f"camera {camera.name}: {camera.address} has no camera of this name, but {names}: correct name")


def _period_ns(times: Sequence[UtcNs]) -> int | None:
    """Median time between two pulses, ns; None if there are less than two."""
    steps = [later - earlier for earlier, later in pairwise(times)]
    return round(median(steps)) if steps else None
