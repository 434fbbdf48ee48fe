"""Reads text in columns: surveys of balls as CSV, and the files of AICON and programs like it (.ior, .eor, .phc, .obc).

A line of words before the numbers, or a comment with them, names the columns; without one they are those of `_USUAL`.
Columns are separated by commas, semicolons, tabs or blanks; with semicolons or tabs a number may have a decimal comma.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from photogrammetry.exchange.part import Part, numbers, rotation_of
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.model import ImageFrame
from rig.errors import BadInputError
from rig.settings.strict_toml import read_text

#: Usual columns by the file's ending; a line may end early.
_USUAL: Final[Mapping[str, tuple[str, ...]]] = {
    ".csv": ("name", "x", "y", "z", "sx", "sy", "sz"),
    ".obc": ("name", "x", "y", "z", "sx", "sy", "sz"),
    ".phc": ("image", "name", "x", "y", "sx", "sy"),
    ".ior": ("camera", "c", "x0", "y0", "a1", "a2", "r0", "a3", "b1", "b2", "c1", "c2"),
    ".eor": ("image", "camera", "x0", "y0", "z0"),
}
ENDINGS: Final = tuple(_USUAL)
#: Other names of columns.
_SAME: Final = {
    **dict.fromkeys(("point", "id", "nr", "ball", "target"), "name"),
    **{f"sigma{gap}{axis}": f"s{axis}" for gap in ("", "_") for axis in "xyz"},
    "sigma": "s",
    "xh": "x0",
    "yh": "y0",
    "ck": "c",
}
_LABELS: Final = ("name", "image", "camera")
_ANGLES: Final = ("omega", "phi", "kappa")
_UNITS: Final = {"deg": math.pi / 180.0, "gon": math.pi / 200.0, "rad": 1.0}


@dataclass(frozen=True, slots=True)
class _Line:
    """A line by the names of its columns; lacking ones are not in it."""

    place: str
    labels: Mapping[str, str]
    values: Mapping[str, float]

    def triple(self, names: Sequence[str]) -> list[float] | None:
        """Three numbers, None if one lacks."""
        return [self.values[name] for name in names] if all(name in self.values for name in names) else None


def read_survey_csv(path: Path) -> Part:
    """Read surveyed balls: name, X, Y, Z and one sigma, or one for each coordinate.

    Raises:
        BadInputError: a ball without sigma, or twice.
    """
    points: dict[str, dict[str, Any]] = {}
    for line in _lines(path):
        name, xyz, sigma = line.labels["name"], line.triple(("x", "y", "z")), _sigmas(line, ("sx", "sy", "sz"))
        if xyz is None:
            raise BadInputError(f"{line.place}: X, Y or Z is missing; write name, X, Y, Z, sigma")
        if sigma is None:
            raise BadInputError(f"{line.place}: sigma is missing; add a column with the standard deviation")
        if name in points:
            raise BadInputError(f"{line.place}: {name!r} is there twice; keep one of them or their mean")
        points[name] = {"role": "control", "X": xyz, "sigma": sigma}
    return Part(str(path), points=points)


def read_aicon(path: Path, sigma_mm: float | None) -> Part:
    """Read a file of interior orientations, poses, image points or object points; image unit mm.

    Args:
        path: ends in .ior, .eor, .phc or .obc.
        sigma_mm: of image points that the file gives no accuracy for; None: they are refused.

    Raises:
        BadInputError: a column is missing; the message says which.
    """
    match path.suffix.lower():
        case ".ior":
            return _interior(path)
        case ".eor":
            return _poses(path)
        case ".phc":
            return _image_points(path, sigma_mm)
        case _:
            return _object_points(path)


def _interior(path: Path) -> Part:
    cameras: dict[str, dict[str, Any]] = {}
    for line in _lines(path):
        if "c" not in line.values:
            raise BadInputError(f"{line.place}: the principal distance is missing; write camera, c, x0, y0, ...")
        entry: dict[str, Any] = {name: line.values[name] for name in (*INTERIOR, "r0") if name in line.values}
        cameras[line.labels["camera"]] = entry | {"c": abs(entry["c"]), "distortion": "measured"}
    return Part(str(path), ImageFrame.METRIC, cameras, notes=(f"{path.name}: c is positive in the network",))


def _poses(path: Path) -> Part:
    images: dict[str, dict[str, Any]] = {}
    notes: tuple[str, ...] = ()
    for line in _lines(path):
        entry: dict[str, Any] = {"camera": line.labels.get("camera")}
        entry["X0"] = line.triple(("x0", "y0", "z0"))
        for unit, factor in _UNITS.items():
            angles = line.triple([f"{angle}_{unit}" for angle in _ANGLES])
            if angles is not None:
                entry["R"] = rotation_of(*(factor * angle for angle in angles)).tolist()
        if "R" not in entry:
            notes = (f"{path.name}: no angles (columns omega_deg, phi_deg, kappa_deg, or _gon, _rad): R is found anew",)
        images[line.labels["image"]] = entry
    return Part(str(path), ImageFrame.METRIC, images=images, notes=notes)


def _image_points(path: Path, sigma: float | None) -> Part:
    rows = []
    for line in _lines(path):
        if "x" not in line.values or "y" not in line.values:
            raise BadInputError(f"{line.place}: x or y is missing; write image, point, x, y, sx, sy")
        given = [line.values.get("sx", line.values.get("s", sigma)), line.values.get("sy", line.values.get("s", sigma))]
        if None in given:
            raise BadInputError(f"{line.place}: sigma is missing; add columns sx, sy (mm), or use --sigma-mm")
        rows.append([line.labels["image"], line.labels["name"], line.values["x"], line.values["y"], *given])
    return Part(str(path), ImageFrame.METRIC, observations=rows)


def _object_points(path: Path) -> Part:
    """Coordinates with a sigma are surveyed, those without are start values."""
    points: dict[str, dict[str, Any]] = {}
    for line in _lines(path):
        xyz, sigma = line.triple(("x", "y", "z")), _sigmas(line, ("sx", "sy", "sz"))
        if xyz is None:
            raise BadInputError(f"{line.place}: X, Y or Z is missing; write point, X, Y, Z, sX, sY, sZ")
        surveyed = {"role": "control", "X": xyz, "sigma": sigma}
        points[line.labels["name"]] = {"role": "tie", "X": xyz} if sigma is None else surveyed
    return Part(str(path), points=points)


def _sigmas(line: _Line, names: Sequence[str]) -> list[float] | None:
    """Sigmas of three coordinates: one each, or one for all; None where they are not positive."""
    each = line.triple(names) or [line.values.get("s", line.values.get(names[0], 0.0))] * 3
    return each if min(each) > 0.0 else None


def _lines(path: Path) -> list[_Line]:
    """All lines of a file with their columns named.

    Raises:
        BadInputError: no line, an unknown column, or a line with too many or without its label.
    """
    columns = _USUAL[path.suffix.lower()]
    found: list[_Line] = []
    for number, text in enumerate(read_text(path, "text", "an existing file").splitlines(), start=1):
        place, words = f"{path}: line {number}", _words(text.lstrip("#! "))
        if not words:
            continue
        if _is_head(words):
            if found and text.startswith(("#", "!")):
                continue
            columns = tuple(_SAME.get(word, word) for word in (each.lower() for each in words))
        elif not text.startswith(("#", "!")):
            found.append(_line(place, columns, words))
    if not found:
        raise BadInputError(f"{path}: is empty; name a file with lines {', '.join(columns)}")
    return found


def _words(text: str) -> list[str]:
    for separator in (";", "\t"):
        if separator in text:
            return [word.strip().replace(",", ".") for word in text.split(separator) if word.strip()]
    return text.replace(",", " ").split()


def _is_head(words: Sequence[str]) -> bool:
    """Whether a line names columns: no word of it is a number, and one is a known column."""
    known = {column for usual in _USUAL.values() for column in usual} | set(_SAME)
    return not any(_is_number(word) for word in words) and any(word.lower() in known for word in words)


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _line(place: str, columns: Sequence[str], words: Sequence[str]) -> _Line:
    if len(words) > len(columns):
        raise BadInputError(
            f"{place}: {len(words)} columns, but only {', '.join(columns)} are known; name them in the first line"
        )
    pairs = list(zip(columns, words, strict=False))
    labels = {column: word for column, word in pairs if column in _LABELS}
    if columns[0] not in labels:
        raise BadInputError(f"{place}: the first column must be a name, not {columns[0]!r}; reorder the columns")
    rest = [(column, word) for column, word in pairs if column not in _LABELS]
    values = dict(zip((column for column, _ in rest), numbers((word for _, word in rest), place), strict=True))
    return _Line(place, labels, values)
