"""COLMAP's binary model (cameras.bin, images.bin, points3D.bin) as the lines of its text model.

All numbers are little-endian. (colmap.github.io/format.html; src/colmap/scene/reconstruction_io.cc)
"""

import struct
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from rig.errors import BadInputError
from rig.settings.strict_toml import read_bytes

#: Names and numbers of parameters of the camera models, by their ids.
_MODELS: Final[Mapping[int, tuple[str, int]]] = {
    0: ("SIMPLE_PINHOLE", 3),
    1: ("PINHOLE", 4),
    2: ("SIMPLE_RADIAL", 4),
    3: ("RADIAL", 5),
    4: ("OPENCV", 8),
    5: ("OPENCV_FISHEYE", 8),
    6: ("FULL_OPENCV", 12),
    7: ("FOV", 5),
    8: ("SIMPLE_RADIAL_FISHEYE", 4),
    9: ("RADIAL_FISHEYE", 5),
    10: ("THIN_PRISM_FISHEYE", 12),
}
_NO_POINT: Final = 2**64 - 1
_MOST_BYTES: Final = 1_000_000_000


def text_of(path: Path) -> str:
    """The text that COLMAP would write for a binary file of this name.

    Raises:
        BadInputError: missing, unreadable, or not whole.
    """
    reader = _Reader(path, read_bytes(path, "binary", "COLMAP's binary model", _MOST_BYTES))
    (count,) = reader.take("Q")
    lines = [line for _ in range(count) for line in _ENTRIES[path.name](reader)]
    reader.require_end()
    return "\n".join(lines) + "\n"


class _Reader:
    def __init__(self, path: Path, data: bytes) -> None:
        self._path, self._data, self._at = path, data, 0

    def take(self, form: str) -> tuple[Any, ...]:
        """The next numbers, as `struct` names them."""
        try:
            values = struct.unpack_from(f"<{form}", self._data, self._at)
        except struct.error:  # fewer bytes than that, or a count that no file holds
            raise self._refused("ends in the middle") from None
        self._at += struct.calcsize(f"<{form}")
        return values

    def text(self) -> str:
        """The next text, which ends with a zero."""
        end = self._data.find(b"\0", self._at)
        if end < 0:
            raise self._refused("ends in the middle")
        name, self._at = self._data[self._at : end], end + 1
        return name.decode("utf-8", errors="replace")

    def model(self, number: int) -> tuple[str, int]:
        """Name and number of parameters of a camera model."""
        if number not in _MODELS:
            raise self._refused(f"names camera model {number}, which is unknown")
        return _MODELS[number]

    def require_end(self) -> None:
        """Refuse bytes behind the last entry."""
        if self._at != len(self._data):
            raise self._refused("is longer than it says")

    def _refused(self, why: str) -> BadInputError:
        return BadInputError(f"{self._path}: {why}; export COLMAP's model again")


def _camera(reader: _Reader) -> Iterator[str]:
    number, model, width, height = reader.take("IiQQ")
    name, count = reader.model(model)
    yield _line(number, name, width, height, *reader.take(f"{count}d"))


def _image(reader: _Reader) -> Iterator[str]:
    number, *pose, camera = reader.take("I7dI")
    yield _line(number, *pose, camera, reader.text())
    (count,) = reader.take("Q")
    triples = (reader.take("ddQ") for _ in range(count))
    yield " ".join(_line(x, y, -1 if point == _NO_POINT else point) for x, y, point in triples)


def _point(reader: _Reader) -> Iterator[str]:
    number, *place, red, green, blue, error, length = reader.take("Q3d3BdQ")
    reader.take(f"{2 * length}I")
    yield _line(number, *place, red, green, blue, error)


def _line(*words: object) -> str:
    return " ".join(map(str, words))


_ENTRIES: Final[Mapping[str, Callable[[_Reader], Iterator[str]]]] = {
    "cameras.bin": _camera,
    "images.bin": _image,
    "points3D.bin": _point,
}
