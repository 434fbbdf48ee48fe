"""Reads pictures of targets: files of any format that OpenCV knows, by folder, and frames of logs, by camera."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from analysis.cameras.frames import LogFrames
from analysis.targets.detection import Sight, find_targets
from analysis.targets.moving import MOVED, shift
from analysis.targets.network_of import FEWEST_CORNERS, Picture
from analysis.targets.pattern import Layout
from analysis.targets.views import SHARP_PX
from rig.errors import BadInputError
from rig.images.picture import Grey
from rig.settings.strict_toml import read_bytes

_LOG: Final = ".mcap"
_LARGEST_FILE: Final = 1 << 29  # bytes
_LOOKED_AT: Final = 90  # pulses of a log, evenly spread
_KEPT: Final = 24  # pictures of a camera out of a log
_SHARP: Final = 1.5  # times the usual width of edges, at most
#: The sensor's own rows and columns: a picture that its file says to turn would be one of another camera.
_READ: Final = cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION


def read_pictures(
    paths: Sequence[Path], layout: Layout, camera: str | None = None, done: Callable[[int], None] = lambda _: None
) -> tuple[list[Picture], list[str]]:
    """Read pictures and find the targets in them.

    Args:
        paths: folders of pictures, whose name is the camera's; folders of such folders; pictures; logs.
        layout: what was printed.
        camera: its name, if the folder is called otherwise.
        done: is told how many pictures have been looked at.

    Returns:
        The pictures that show enough of the target, and a line about each that is not used.

    Raises:
        BadInputError: no pictures, no targets, pictures of several sizes, or a file that is none.
    """
    notes: list[str] = []
    parts = [part for path in paths for part in _parts(path, layout, notes)]
    seen: list[Picture] = []
    looked = 0
    for part in parts:
        for picture in part:
            seen.append(picture if camera is None else replace(picture, camera=camera))
            looked += 1
            done(looked)
    if not seen:
        strange = f" that can be read ({notes[0]}); save them as PNG, TIFF or JPEG" if notes else ""
        remedy = "" if notes else "; name a folder of pictures, or a log"
        raise BadInputError(f"{', '.join(map(str, paths))}: no pictures in it{strange}{remedy}")
    _require_one_size(seen)
    _require_own_names(seen)
    seen = _without_doubled(_without_copies(seen, notes), layout, notes)
    used = [picture for picture in seen if len(picture.sight.corners) >= FEWEST_CORNERS]
    notes += [f"{picture.name} is left out: {_why(picture.sight)}" for picture in seen if picture not in used]
    if not used:
        mirrored = sum(picture.sight.mirrored for picture in seen)
        raise BadInputError(
            f"{mirrored} of {len(seen)} pictures show the targets in a mirror: turn off the camera's mirror or "
            "flip, or print the targets anew if they are printed mirrored"
            if mirrored
            else f"no targets in {len(seen)} pictures: take pictures of what svev target prints, larger and in focus"
        )
    return used, notes


def _why(sight: Sight) -> str:
    if sight.mirrored:
        return "it shows the targets in a mirror"
    return f"{len(sight.corners)} corners of targets in it, {FEWEST_CORNERS} are needed"


def _parts(path: Path, layout: Layout, notes: list[str]) -> Iterator[Iterator[Picture]]:
    if not path.exists():
        raise BadInputError(f"{path}: no such folder, picture or log; correct the path")
    if path.is_dir():
        inside = sorted(path.iterdir())
        yield _of_files([each for each in inside if each.is_file()], layout, notes)
        for folder in inside:
            if folder.is_dir():
                yield _of_files(sorted(each for each in folder.iterdir() if each.is_file()), layout, notes)
    elif path.suffix.lower() == _LOG:
        yield _of_log(path, layout)
    else:
        yield _of_files([path], layout, None)


def _of_files(paths: Sequence[Path], layout: Layout, notes: list[str] | None) -> Iterator[Picture]:
    """The pictures among some files; without `notes` each file must be one."""
    for path in paths:
        image = _picture(path)
        name = f"{path.resolve().parent.name}/{path.name}"
        if image is not None:
            yield Picture(path.resolve().parent.name, name, find_targets(image, layout, name))
        elif notes is None:
            raise BadInputError(f"{path}: is no picture and no log; name a folder of pictures, or a log (.mcap)")
        elif path.suffix.lower() == _LOG:
            raise BadInputError(f"{path}: is a log in a folder of pictures; name the log itself")
        else:
            notes.append(f"{name} is left out: it is no picture of a format that is known")


def _picture(path: Path) -> Grey | None:
    """The grey values of a file in levels of eight bits; None if it is no picture."""
    data = np.frombuffer(read_bytes(path, "a picture", "an existing picture", _LARGEST_FILE), np.uint8)
    image = cv2.imdecode(data, _READ) if len(data) else None
    if image is None or image.dtype == np.uint8:
        return None if image is None else np.asarray(image, np.uint8)
    if image.dtype == np.uint16:  # cameras put 10 or 12 bits into the lower end of 16
        scale = ((1 << max(int(image.max()).bit_length(), 8)) - 1) / 255.0
    else:
        scale = float(image.max()) / 255.0 or 1.0
    return np.asarray(image / scale, np.float32)


def _of_log(path: Path, layout: Layout) -> Iterator[Picture]:
    """Frames of a log that are sharp and show the target elsewhere than the others of their camera."""
    frames = LogFrames(path)
    pulses = frames.pulses
    if not pulses:
        raise BadInputError(f"{path}: no frames in it; name another log")
    some = {pulses[i] for i in np.linspace(0, len(pulses) - 1, min(len(pulses), _LOOKED_AT)).round().astype(int)}
    by_camera: dict[str, list[Picture]] = {}
    for pulse, images in frames.frames(some):
        for camera, image in images.items():
            name = f"{path.stem}/{camera}@{pulse}"
            by_camera.setdefault(camera, []).append(Picture(camera, name, find_targets(image, layout, name)))
    for pictures in by_camera.values():
        yield from _different(pictures)


def _different(pictures: Sequence[Picture]) -> list[Picture]:
    """The sharp pictures of a camera between which the target has moved, `_KEPT` at most."""
    full = [picture for picture in pictures if len(picture.sight.corners) >= FEWEST_CORNERS]
    if not full:
        return list(pictures[:1])
    usual = float(np.median([picture.sight.blur for picture in full]))
    full = [picture for picture in full if picture.sight.blur <= _SHARP * max(usual, SHARP_PX)]
    least = MOVED * float(np.hypot(*full[0].sight.size))
    while True:
        kept: list[Picture] = []
        for picture in full:
            if all(shift(picture.sight, other.sight) > least for other in kept):
                kept.append(picture)
        if len(kept) <= _KEPT:
            return kept
        least *= 1.3


def _require_one_size(pictures: Sequence[Picture]) -> None:
    first: dict[str, Picture] = {}
    for picture in pictures:
        other = first.setdefault(picture.camera, picture)
        if other.sight.size != picture.sight.size:
            turned = other.sight.size == picture.sight.size[::-1]
            remedy = (
                "a program has turned one of them; take the files as the camera wrote them"
                if turned
                else "a calibration belongs to one size; sort the pictures into one folder for each camera and size"
            )
            raise BadInputError(
                f"camera {picture.camera}: {other.name} has {other.sight.size[0]} x {other.sight.size[1]} px, "
                f"{picture.name} {picture.sight.size[0]} x {picture.sight.size[1]} px: {remedy}"
            )


def _require_own_names(pictures: Sequence[Picture]) -> None:
    names = [picture.name for picture in pictures]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise BadInputError(f"{twice[0]} is named twice; name each picture once, and call folders by their cameras")


def _without_copies(pictures: Sequence[Picture], notes: list[str]) -> list[Picture]:
    """The pictures, each once: a copy would count as another measurement."""
    kept: list[Picture] = []
    for picture in pictures:
        same = (other for other in kept if picture.sight.corners and other.sight.corners == picture.sight.corners)
        if (other := next(same, None)) is None:
            kept.append(picture)
        else:
            notes.append(f"{picture.name} is left out: it is a copy of {other.name}")
    return kept


def _without_doubled(pictures: Sequence[Picture], layout: Layout, notes: list[str]) -> list[Picture]:
    """The pictures without targets that one of them shows twice: which copy another shows cannot be told."""
    doubled = {code: picture.name for picture in pictures for code in picture.sight.doubled}
    if not doubled:
        return list(pictures)
    for code, name in sorted(doubled.items()):
        notes.append(f"target {code} is left out: it is twice in {name}; print and use each target once")
    gone = {corner for code in doubled for corner in layout.corners(code)}
    return [_without(picture, gone, doubled) for picture in pictures]


def _without(picture: Picture, corners: "set[str | None]", codes: "dict[int, str]") -> Picture:
    sight = picture.sight
    left = replace(
        sight,
        corners={name: corner for name, corner in sight.corners.items() if name not in corners},
        targets={code: square for code, square in sight.targets.items() if code not in codes},
    )
    return replace(picture, sight=left)
