"""The films of an import: opened, checked against each other, with the frame of each that is pulse 1."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from recorder.importing.flash import flashes
from recorder.importing.image_folder import ImageFolder
from recorder.importing.source import Film
from recorder.importing.tiff_pages import ENDINGS, TiffPages
from recorder.importing.video import Video
from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.images.pixels import FORMATS, Pixels
from rig.settings.model import RigSettings
from rig.transport.recorder_commands import Calibration

#: Significant bits that a log can hold, in grey values.
BITS: Final = tuple(sorted({each.pixels.bits for each in FORMATS.values()}))


@dataclass(frozen=True, slots=True)
class ImportOrder:
    """What is to be imported, and how.

    Attributes:
        cameras: name of the camera and place of its film, left to right.
        rate_hz: frames per second when the films were taken.
        out: the new log.
        starts: by camera, number of the frame that is pulse 1; others begin with their first frame.
        flash: pulse 1 is the flash that all films show.
        first, last: only these pulses, counted from the common start; they are numbered anew. None: all.
        bits: significant bits of images with 16; None: all 16.
        date: of the common start, UTC; None: what the films say.
        rig: the rig file's settings, and its text; None: there is none.
        calibration: of the rig's cameras; None: it is not known.
        replace: put the log in the place of a file of its name.
    """

    cameras: Sequence[tuple[str, Path]]
    rate_hz: float
    out: Path
    starts: Mapping[str, int] = field(default_factory=dict)
    flash: bool = False
    first: int = 1
    last: int | None = None
    bits: int | None = None
    date: UtcNs | None = None
    rig: tuple[RigSettings, bytes] | None = None
    calibration: Calibration | None = None
    replace: bool = False


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera and its film.

    Attributes:
        name: of the camera.
        film: of it.
        bits: how many bits of the film's grey values are significant.
    """

    name: str
    film: Film
    bits: int


def opened(order: ImportOrder) -> list[Camera]:
    """Open the films of an order, left to right.

    Raises:
        BadInputError: something of the order does not fit together, or a film cannot be read.
    """
    if order.starts and order.flash:
        raise BadInputError("--start and --flash both say which frame is pulse 1: give one of them")
    names = [name for name, _ in order.cameras]
    for name in order.starts:
        if name not in names:
            raise BadInputError(f"--start names {name}, and the cameras are {', '.join(names)}; correct it")
    cameras = []
    for name, path in order.cameras:
        film = _opened(path, order.rate_hz)
        cameras.append(Camera(name, film, film.bits if film.bits < BITS[-1] else order.bits or film.bits))
    if order.bits is not None and all(camera.film.bits < BITS[-1] for camera in cameras):
        raise BadInputError(f"--bits {order.bits} is for images of 16 bits, and none has so many; leave it out")
    if order.rig is not None:
        _check_sizes(cameras, order.rig[0])
    return cameras


def _opened(path: Path, rate_hz: float) -> Film:
    if path.is_dir():
        return ImageFolder(path)
    return TiffPages(path) if path.suffix.lower() in ENDINGS else Video(path, rate_hz)


def pixels_of(cameras: Sequence[Camera]) -> Pixels:
    """How a log holds the grey values of these cameras: with the fewest bits that do for all."""
    most = max(camera.bits for camera in cameras)
    bits = next(each for each in BITS if each >= most)
    return Pixels("mono8" if bits == 8 else "mono16", bits)


def common_start(cameras: Sequence[Camera], order: ImportOrder, read: Callable[[], None]) -> dict[str, int]:
    """By camera, number of the frame that is pulse 1.

    Args:
        cameras: whose films they are.
        order: says how it is found.
        read: called for each frame that is read for that.

    Raises:
        BadInputError: a film shows no flash, or several.
    """
    if not order.flash:
        return {camera.name: order.starts.get(camera.name, camera.film.first) for camera in cameras}
    return {camera.name: _flash(camera, read) for camera in cameras}


def _flash(camera: Camera, read: Callable[[], None]) -> int:
    """Number of the frame of a camera's film that shows the flash first."""
    numbers, means = [], []
    for taken in camera.film.frames(camera.film.first):
        numbers.append(taken.number)
        means.append(np.nan if taken.pixels is None else float(taken.pixels.mean()))
        read()
    places = flashes(np.array(means) / ((1 << camera.bits) - 1))
    how = "say which frame is pulse 1 by --start, for each camera"
    if not places:
        raise BadInputError(f"{camera.film.path}: shows no flash, no frame is brighter all at once: {how}")
    if len(places) > 1:
        frames = ", ".join(str(numbers[place]) for place in places[:10]) + ", ..." * (len(places) > 10)
        raise BadInputError(
            f"{camera.film.path}: becomes brighter {len(places)} times (frames {frames}), and any "
            f"of them may be the flash: {how}"
        )
    return numbers[places[0]]


def _check_sizes(cameras: Sequence[Camera], rig: RigSettings) -> None:
    for camera, settings in zip(cameras, rig.cameras, strict=True):
        (width, height), region = camera.film.size, settings.region
        if (region.width, region.height) != (width, height):
            raise BadInputError(
                f"{camera.film.path}: its images are {width} x {height} px, and the rig file gives {camera.name} "
                f"{region.width} x {region.height}: correct region of {camera.name} in the rig file"
            )
