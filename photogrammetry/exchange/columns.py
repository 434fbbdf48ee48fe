"""Reads surveys of balls as CSV, and the files of AICON and programs like it (.ior, .eor, .phc, .obc)."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from photogrammetry.exchange.part import Part, rotation_of
from photogrammetry.exchange.table import ANGLE_UNITS, ANGLES, SIGMAS, Line, read_lines
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.model import ImageFrame
from rig.errors import BadInputError

#: Characters that separate cells in files of other dialects.
_SEPARATING: Final = re.compile(r"[,;\t ]")
#: No camera has a shorter principal distance, mm.
_SHORTEST_MM: Final = 1.0


def read_survey_csv(path: Path) -> Part:
    """Read surveyed balls: name, X, Y, Z and one sigma, or one for each coordinate.

    Raises:
        BadInputError: a ball without sigma, or twice.
    """
    points: dict[str, dict[str, Any]] = {}
    lines, notes = read_lines(path)
    for line in lines:
        xyz, sigma = line.triple(("x", "y", "z")), _sigmas(line)
        if xyz is None:
            raise BadInputError(f"{line.place}: X, Y or Z is missing; write name, X, Y, Z, sigma")
        if sigma is None:
            raise BadInputError(f"{line.place}: sigma is missing; add a column with the standard deviation")
        points[_new(line, "name", points)] = {"role": "control", "X": xyz, "sigma": sigma}
    return Part(str(path), points=points, notes=notes)


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
    lines, notes = read_lines(path)
    for line in lines:
        if "c" not in line.values:
            raise BadInputError(f"{line.place}: the principal distance is missing; write camera, c, x0, y0, ...")
        if abs(line.values["c"]) < _SHORTEST_MM:
            raise BadInputError(f"{line.place}: c = {line.values['c']:g} mm is no principal distance; correct it")
        if "x0" not in line.values:
            _require_single(line)
        entry: dict[str, Any] = {name: line.values[name] for name in (*INTERIOR, "r0") if name in line.values}
        cameras[_new(line, "camera", cameras)] = entry | {"c": abs(entry["c"]), "distortion": "measured"}
    return Part(str(path), ImageFrame.METRIC, cameras, notes=(*notes, f"{path.name}: c is positive in the network"))


def _poses(path: Path) -> Part:
    images: dict[str, dict[str, Any]] = {}
    lines, notes = read_lines(path)
    for line in lines:
        entry: dict[str, Any] = {"camera": line.labels.get("camera")}
        entry["X0"] = line.triple(("x0", "y0", "z0"))
        if entry["X0"] is None:
            _require_single(line)
        for unit, factor in ANGLE_UNITS.items():
            angles = line.triple([f"{angle}_{unit}" for angle in ANGLES])
            if angles is not None and "R" in entry:
                raise BadInputError(f"{line.place}: has angles in two units; remove one")
            if angles is not None:
                entry["R"] = rotation_of(*(factor * angle for angle in angles)).tolist()
        images[_new(line, "image", images)] = entry
    if any("R" not in entry for entry in images.values()):
        without = f"{path.name}: no angles (columns omega_deg, phi_deg, kappa_deg, or _gon, _rad): R is found anew"
        notes = (*notes, without)
    return Part(str(path), ImageFrame.METRIC, images=images, notes=notes)


def _require_single(line: Line) -> None:
    """Refuse a line without coordinates where the separator of other cells stands in a name."""
    for name in line.labels.values():
        if _SEPARATING.search(name):
            raise BadInputError(
                f"{line.place}: {name!r} may be several cells; write one separator in all lines, and "
                '"..." around names that hold it'
            )


def _image_points(path: Path, sigma: float | None) -> Part:
    rows = []
    lines, notes = read_lines(path)
    for line in lines:
        if "x" not in line.values or "y" not in line.values:
            raise BadInputError(f"{line.place}: x or y is missing; write image, point, x, y, sx, sy")
        one = line.values.get("s", None if {"sx", "sy"} & set(line.values) else sigma)
        given = [line.values.get("sx", one), line.values.get("sy", one)]
        if None in given:
            raise BadInputError(f"{line.place}: sigma is missing; add columns sx, sy (mm), or use --sigma-mm")
        rows.append([line.labels["image"], line.labels["name"], line.values["x"], line.values["y"], *given])
    return Part(str(path), ImageFrame.METRIC, observations=rows, notes=notes)


def _object_points(path: Path) -> Part:
    """Coordinates with a sigma are surveyed, those without are start values."""
    points: dict[str, dict[str, Any]] = {}
    lines, notes = read_lines(path)
    for line in lines:
        xyz, sigma = line.triple(("x", "y", "z")), _sigmas(line)
        if xyz is None:
            raise BadInputError(f"{line.place}: X, Y or Z is missing; write point, X, Y, Z, sX, sY, sZ")
        surveyed = {"role": "control", "X": xyz, "sigma": sigma}
        points[_new(line, "name", points)] = {"role": "tie", "X": xyz} if sigma is None else surveyed
    return Part(str(path), points=points, notes=notes)


def _new(line: Line, label: str, there: Mapping[str, Any]) -> str:
    """The name that a line gives to its thing, which must be the first of this name."""
    name = line.labels[label]
    if name in there:
        raise BadInputError(f"{line.place}: {name!r} is there twice; keep one of them or their mean")
    return name


def _sigmas(line: Line) -> list[float] | None:
    """Sigmas of three coordinates: one each, or one for all; None where there is none, or all are 0.

    Raises:
        BadInputError: two sigmas, one for all beside others, or one that is negative or, beside others, 0.
    """
    given = {name: line.values[name] for name in SIGMAS if name in line.values}
    alone = [{name} for name in ("s", "sx")]
    if not given or not any(given.values()):
        return None
    if set(given) not in (*alone, {"sx", "sy", "sz"}):
        raise BadInputError(f"{line.place}: sigmas {', '.join(given)}: give one for all, or sX, sY and sZ")
    if min(given.values()) <= 0.0:
        raise BadInputError(f"{line.place}: a sigma of {min(given.values()):g} is none; it must be positive")
    return list(given.values()) if len(given) == 3 else list(given.values()) * 3
