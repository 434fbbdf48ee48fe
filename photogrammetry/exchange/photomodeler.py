"""Reads the text that PhotoModeler exports for other programs ("Bundle Soln ...").

Five lines of a head (the second ends with the image's width and height, px), then six lines for each photo (name; X, Y,
Z, kappa, phi, omega in degrees; their sigmas; covariances or nothing; focal length, principal point, format size in mm,
K1, K2, K3, P1, P2; their sigmas), an empty line, control points, an empty line, object points, an empty line, marks.

Marks are px from the upper left corner, y down. PhotoModeler corrects measured coordinates by adding distortion:
xc = x + x (K1 r^2 + K2 r^4 + K3 r^6) + P1 (r^2 + 2 x^2) + 2 P2 x y, mm from the principal point, y up. The network's
"measured" distortion subtracts: all signs change. (PhotoModeler's help, Lens Distortion Formulation)
"""

import math
from collections.abc import Mapping
from pathlib import Path, PureWindowsPath
from typing import Any, Final

import numpy as np

from photogrammetry.exchange.part import Part, numbers, rotation_of
from photogrammetry.exchange.vision.pinhole import doubts
from photogrammetry.network.model import ImageFrame
from rig.errors import BadInputError
from rig.settings.strict_toml import read_text

_HEAD: Final = 5  # lines


class _Lines:
    """The lines of a file, with their numbers for messages."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lines = read_text(path, "text", "an existing PhotoModeler export").splitlines()
        self._next = 0

    @property
    def place(self) -> str:
        """Where the last line stands."""
        return f"{self._path}: line {self._next}"

    def take(self) -> list[str]:
        """The words of the next line; none at the end of the file."""
        self._next += 1
        return self._lines[self._next - 1].split() if self._next <= len(self._lines) else []

    def take_numbers(self, count: int, what: str) -> list[float]:
        """The next line, which must have so many numbers."""
        found = numbers(self.take(), self.place)
        if len(found) != count:
            raise BadInputError(f"{self.place}: {len(found)} numbers instead of {count}: {what}; export again")
        return found

    def block(self, count: int, what: str) -> list[tuple[list[str], list[float]]]:
        """Lines until an empty one: the words, and the `count` numbers behind the first."""
        found = []
        while words := self.take():
            row = numbers(words[1:], self.place)
            if len(row) != count:
                raise BadInputError(f"{self.place}: {len(row)} numbers instead of {count}: {what}; export again")
            found.append((words, row))
        return found


def read_photomodeler(path: Path, sigma: float) -> Part:
    """Read an export.

    Args:
        path: of the file.
        sigma: of image points (px) that the file gives no accuracy for.

    Raises:
        BadInputError: the file is none, or does not say how large the images are.
    """
    lines = _Lines(path)
    size = _size(lines, path)
    cameras: dict[str, dict[str, Any]] = {}
    images: dict[str, dict[str, Any]] = {}
    order: dict[str, str] = {}
    formats: dict[str, tuple[float, float]] = {}
    doubted: dict[str, str] = {}
    while words := lines.take():
        if len(words) < 2:
            raise BadInputError(f"{lines.place}: no photo's number and name; name a text export of PhotoModeler")
        name = PureWindowsPath(" ".join(words[1:])).stem
        if name in images:
            raise BadInputError(f"{lines.place}: two photos are called {name!r}; rename one")
        images[name], interior = _photo(lines)
        if words[0] in order:
            raise BadInputError(f"{lines.place}: two photos have the number {words[0]}; export again")
        order[words[0]] = name
        entry = _camera(interior, size)
        camera = next((known for known, other in cameras.items() if other == entry), f"camera-{len(cameras) + 1}")
        cameras[camera] = entry
        images[name]["camera"] = camera
        formats[name] = (interior[3], interior[4])
        if (said := doubts(formats[name], (entry["x0"], entry["y0"]), "mm")) and camera not in doubted:
            doubted[camera] = f"camera {camera}: {said[0]}"
    points = _points(lines)
    observations = _marks(lines, order, formats, size, sigma)
    constant = 'interior orientations are constant: name the unknown ones in "estimate"'
    notes = (
        "image coordinates are in mm now, from the middle of the image, y up",
        f"{constant}; the sigmas of PhotoModeler's results (poses, object points) are left out",
        *doubted.values(),
    )
    return Part(str(path), ImageFrame.METRIC, cameras, images, points, observations, notes)


def _size(lines: _Lines, path: Path) -> tuple[float, float]:
    """Width and height from the head (px)."""
    head = [lines.take() for _ in range(_HEAD)]
    if len(head[1]) < 2 or len(head[3]) != 10:
        raise BadInputError(
            f"{path}: is no text export of PhotoModeler; name a COLMAP model, .csv, .yml, .ior or .phc file"
        )
    if len(head[1]) < 4:
        raise BadInputError(f"{path}: line 2: the image size is missing; add width and height (px) at its end")
    width, height = numbers(head[1][2:4], f"{path}: line 2")
    if min(width, height) < 1.0 or width % 1.0 or height % 1.0:
        raise BadInputError(f"{path}: line 2: width and height of the image must be positive, whole (px); correct them")
    return width, height


def _photo(lines: _Lines) -> tuple[dict[str, Any], list[float]]:
    """Pose of a photo, and its interior orientation (10 numbers)."""
    x, y, z, kappa, phi, omega = lines.take_numbers(7, "number, X, Y, Z, kappa, phi, omega")[1:]
    lines.take_numbers(7, "their sigmas")
    lines.take()  # covariances, or nothing
    interior = lines.take_numbers(11, "number, focal length, principal point, format size, K1, K2, K3, P1, P2")[1:]
    lines.take_numbers(11, "their sigmas")
    rotation = rotation_of(math.radians(omega), math.radians(phi), math.radians(kappa))
    return {"X0": [x, y, z], "R": rotation.tolist()}, interior


def _camera(interior: list[float], size: tuple[float, float]) -> dict[str, Any]:
    c, xp, yp, width, height, k1, k2, k3, p1, p2 = interior
    return {
        "size": [int(size[0]), int(size[1])],
        "c": c,
        "x0": xp - width / 2.0,
        "y0": height / 2.0 - yp,
        "a1": -k1,
        "a2": -k2,
        "a3": -k3,
        "b1": -p1,
        "b2": -p2,
        "distortion": "measured",
    }


def _points(lines: _Lines) -> dict[str, dict[str, Any]]:
    """Control points, surveyed or (without sigma) fixed, then object points, whose coordinates are start values."""
    points: dict[str, dict[str, Any]] = {}
    for (name, *_), row in lines.block(6, "X, Y, Z and their sigmas of a control point"):
        if name in points:
            raise BadInputError(f"{lines.place}: control point {name!r} is there twice; keep one of them")
        surveyed = min(row[3:]) > 0.0
        points[name] = {"role": "control" if surveyed else "fixed", "X": row[:3]} | (
            {"sigma": row[3:]} if surveyed else {}
        )
    objects: set[str] = set()
    for (name, *_), row in lines.block(6, "X, Y, Z and their sigmas of an object point"):
        if name in objects:
            raise BadInputError(f"{lines.place}: object point {name!r} is there twice; export again")
        objects.add(name)
        points.setdefault(name, {"role": "tie", "X": row[:3]})
    return points


def _marks(
    lines: _Lines,
    order: Mapping[str, str],
    formats: Mapping[str, tuple[float, float]],
    size: tuple[float, float],
    sigma: float,
) -> list[list[Any]]:
    """Observations in mm."""
    rows = []
    for (photo, point, *_), row in lines.block(5, "point, x, y and their sigmas of a mark"):
        if photo not in order:
            raise BadInputError(f"{lines.place}: photo {photo} is not listed above; export again")
        name = order[photo]
        pixel = np.array(formats[name]) / size
        x, y = np.array((row[1] - size[0] / 2.0, size[1] / 2.0 - row[2])) * pixel
        sigmas = np.array([each if each > 0.0 else sigma for each in row[3:]]) * pixel
        rows.append([name, point, float(x), float(y), *sigmas.tolist()])
    return rows
