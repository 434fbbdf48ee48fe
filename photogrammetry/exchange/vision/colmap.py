"""Reads COLMAP's model, text (cameras.txt, images.txt, points3D.txt) or binary (.bin).

COLMAP counts pixels from the corner of the picture: the centre of the top left pixel is (0.5, 0.5). Its pose is the
quaternion and translation from object to camera system. (colmap.github.io/format.html, cameras.html)
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from photogrammetry.exchange.part import Part, numbers
from photogrammetry.exchange.vision.colmap_binary import text_of
from photogrammetry.exchange.vision.pinhole import Pinhole, camera_entry, pose_entry
from photogrammetry.network.model import ImageFrame
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.settings.strict_toml import read_text

_PARTS: Final = ("cameras", "images", "points3D")
_ENDINGS: Final = (".txt", ".bin")
FILES: Final = tuple(part + ending for part in _PARTS for ending in _ENDINGS)
#: Since COLMAP 3.12: which cameras stand together, of which every image has its pose all the same.
FRAMES: Final = tuple(part + ending for part in ("rigs", "frames") for ending in _ENDINGS)
_CORNER: Final = 0.5  # px, from COLMAP's origin to the centre of the first pixel
#: Models that can be carried over: number of focal lengths, and what the parameters after cx, cy are.
_MODELS: Final[Mapping[str, tuple[int, tuple[str, ...]]]] = {
    "SIMPLE_PINHOLE": (1, ()),
    "PINHOLE": (2, ()),
    "SIMPLE_RADIAL": (1, ("k1",)),
    "RADIAL": (1, ("k1", "k2")),
    "OPENCV": (2, ("k1", "k2", "p1", "p2")),
    "FULL_OPENCV": (2, ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")),
}


def read_colmap(files: Mapping[str, Path], sigma: float) -> Part:
    """Read a model.

    Args:
        files: paths by the names of `FILES`; any may be missing.
        sigma: of image points (px), which COLMAP does not write.

    Raises:
        BadInputError: a line is not as COLMAP writes it, or a camera model cannot be carried over.
    """
    found = {part: _one_of(part, files) for part in _PARTS}
    cameras: dict[str, dict[str, Any]] = {}
    notes: list[str] = []
    if found["cameras"]:
        for place, words in _lines(found["cameras"]):
            _require_new(words[0], cameras, place)
            cameras[words[0]], said = _camera(words, place)
            notes += [f"camera {words[0]}: {note}" for note in said]
    images, observations = _images(found["images"], sigma, notes) if found["images"] else ({}, [])
    points = _points(found["points3D"]) if found["points3D"] else {}
    if observations:
        notes.append(f"COLMAP writes no accuracy of image points: {sigma:g} px assumed (--sigma)")
        notes.append("COLMAP's object system has neither scale nor axes: add surveyed balls, or distances")
    source = str(next(iter(files.values())).parent)
    return Part(source, ImageFrame.PIXEL, cameras, images, points, observations, tuple(notes))


def _one_of(part: str, files: Mapping[str, Path]) -> Path | None:
    """The file of a part of the model: text or binary.

    Raises:
        BadInputError: both are there, and they may differ.
    """
    there = [files[name] for name in (f"{part}.txt", f"{part}.bin") if name in files]
    if len(there) > 1:
        raise BadInputError(
            f"{there[0].parent}: has {part} as text and as binary; name the files of one, or remove one"
        )
    return there[0] if there else None


def _text(path: Path) -> str:
    return text_of(path) if path.suffix == ".bin" else read_text(path, "text", "COLMAP's text model")


def _lines(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Place and words of each line that is no comment."""
    for number, line in enumerate(_text(path).splitlines(), start=1):
        if line.strip() and not line.startswith("#"):
            yield f"{path}: line {number}", line.split()


def _require_new(name: str, there: Mapping[str, Any], place: str) -> None:
    """Refuse a name that stands in the file already."""
    if name in there:
        raise BadInputError(f"{place}: {name!r} is there twice; keep one of them, or export the model again")


def _camera(words: list[str], place: str) -> tuple[dict[str, Any], list[str]]:
    if len(words) < 5:
        raise BadInputError(f"{place}: is no camera; COLMAP writes CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS")
    model = words[1]
    if model not in _MODELS:
        known = ", ".join(_MODELS)
        raise BadInputError(f"{place}: model {model} cannot be carried over; choose one of {known} in COLMAP")
    focal_lengths, names = _MODELS[model]
    values = numbers(words[2:], place)
    width, height, *rest = values
    if width % 1.0 or height % 1.0:
        raise BadInputError(f"{place}: an image size of {width:g} x {height:g} px is none; export the model again")
    if len(rest) != focal_lengths + 2 + len(names):
        raise BadInputError(f"{place}: {model} has {len(rest)} parameters instead of {focal_lengths + 2 + len(names)}")
    given = dict(zip(names, rest[focal_lengths + 2 :], strict=True))
    k1, k2, k3, k4, k5, k6, p1, p2 = (given.get(name, 0.0) for name in ("k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"))
    cx, cy = rest[focal_lengths : focal_lengths + 2]
    pinhole = Pinhole(
        (int(width), int(height)),
        (rest[0], rest[focal_lengths - 1]),
        (cx - _CORNER, cy - _CORNER),
        (k1, k2, k3, k4, k5, k6),
        (p1, p2),
    )
    return camera_entry(pinhole, place, "COLMAP")


def _images(path: Path, sigma: float, notes: list[str]) -> tuple[dict[str, dict[str, Any]], list[list[Any]]]:
    """Images and observations; two lines an image, of which the second may be empty."""
    images: dict[str, dict[str, Any]] = {}
    rows: list[list[Any]] = []
    twice = 0
    lines = enumerate(_text(path).splitlines(), start=1)
    for number, line in lines:
        if not line.strip() or line.startswith("#"):
            continue
        place, words = f"{path}: line {number}", line.split(maxsplit=9)
        if len(words) != 10:
            raise BadInputError(
                f"{place}: is no image; COLMAP writes IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME"
            )
        pose = numbers(words[1:8], place)
        if not any(pose[:4]):
            raise BadInputError(f"{place}: a quaternion of zeros is no rotation; export the model again")
        _require_new(words[9], images, place)
        images[words[9]] = {"camera": words[8], **pose_entry(_rotation(np.array(pose[:4])), np.array(pose[4:]))}
        found = _observations(next(lines, (0, ""))[1].split(), f"{path}: line {number + 1}")
        once = {point: (x, y) for x, y, point in reversed(found)}
        twice += len(found) - len(once)
        rows += [[words[9], point, x, y, sigma] for point, (x, y) in reversed(once.items())]
    if twice:
        notes.append(f"{twice} further measurements of a point in the same image are left out")
    return images, rows


def _observations(words: list[str], place: str) -> list[tuple[float, float, str]]:
    """x, y in the pixel frame and the point of each measurement that belongs to one."""
    if len(words) % 3:
        raise BadInputError(f"{place}: image points are triples X, Y, POINT3D_ID; correct it there")
    found = []
    for x, y, point in zip(words[::3], words[1::3], words[2::3], strict=True):
        if point != "-1":
            across, down = numbers((x, y), place)
            found.append((round(across - _CORNER, 9), round(down - _CORNER, 9), point))
    return found


def _points(path: Path) -> dict[str, dict[str, Any]]:
    points: dict[str, dict[str, Any]] = {}
    for place, words in _lines(path):
        if len(words) < 4:
            raise BadInputError(f"{place}: is no point; COLMAP writes POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK")
        _require_new(words[0], points, place)
        points[words[0]] = {"role": "tie", "X": numbers(words[1:4], place)}
    return points


def _rotation(quaternion: Floats) -> Floats:
    """(3, 3) of a quaternion w, x, y, z of any length."""
    bounded = quaternion / np.abs(quaternion).max()
    w, x, y, z = bounded / np.linalg.norm(bounded)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
