"""What one file of another program holds, in the words of `svev-network/1`, and how several become one network."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from photogrammetry.network.model import ImageFrame
from rig.arrays import Floats
from rig.errors import BadInputError

#: Numbers as programs write them: no grouping ("1_000"), no other digits than ours, of which Python reads both.
_WRITTEN: Final = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)


@dataclass(frozen=True, slots=True)
class Part:
    """What one file holds.

    Attributes:
        source: the file, for messages.
        frame: of image points and cameras; None: the file has neither.
        cameras: entries by name, as in the network file.
        images: likewise; the camera is None where the file does not say it.
        points: likewise.
        observations: rows of the network file.
        notes: what could not be carried over, and what was assumed.
    """

    source: str
    frame: ImageFrame | None = None
    cameras: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    images: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    points: Mapping[str, dict[str, Any]] = field(default_factory=dict)
    observations: Sequence[list[Any]] = ()
    notes: tuple[str, ...] = ()


def joined(parts: Sequence[Part], length_unit: str) -> dict[str, Any]:
    """One network file's object out of parts; surveyed coordinates replace others of the same point.

    Raises:
        BadInputError: the parts do not fit together; the message says what to do.
    """
    frame = _frame(parts)
    cameras = _together(parts, "cameras", "camera")
    images = _together(parts, "images", "image")
    points = _together(parts, "points", "point")
    observations = [row for part in parts for row in part.observations]
    for row in observations:
        images.setdefault(row[0], {})
        points.setdefault(row[1], {"role": "tie"})
    _name_cameras(images, cameras)
    surveyed = any(point["role"] != "tie" for point in points.values())
    return {
        "format": "svev-network/1",
        "length_unit": length_unit,
        "image_frame": frame.value,
        "cameras": cameras,
        "images": images,
        "points": points,
        "observations": observations,
        "datum": {"type": "control" if surveyed or not observations else "inner"},
    }


def rotation_of(omega: float, phi: float, kappa: float) -> Floats:
    """R = Rx(omega) Ry(phi) Rz(kappa), (3, 3), of angles in rad: the rotation of photogrammetric programs."""
    (so, co), (sp, cp), (sk, ck) = ((np.sin(angle), np.cos(angle)) for angle in (omega, phi, kappa))
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, co, -so], [0.0, so, co]])
    about_y = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_z = np.array([[ck, -sk, 0.0], [sk, ck, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_x @ about_y @ about_z)


def numbers(words: Iterable[str], place: str) -> list[float]:
    """Finite numbers of a line.

    Raises:
        BadInputError: a word is none; `place` says where.
    """
    found = []
    for word in words:
        if not is_written_number(word):
            raise BadInputError(f"{place}: {word!r} is no number; correct it there")
        number = float(word)
        if not np.isfinite(number):
            raise BadInputError(f"{place}: {word!r} is no finite number; correct it there")
        found.append(number)
    return found


def is_written_number(word: str) -> bool:
    """Whether a word is a number as programs write it, with a decimal point."""
    return _WRITTEN.fullmatch(word) is not None


def _frame(parts: Sequence[Part]) -> ImageFrame:
    """The frame of all parts; the pixel frame where none has any."""
    known = {part.frame: part.source for part in parts if part.frame is not None}
    if len(known) > 1:
        pixel, metric = known[ImageFrame.PIXEL], known[ImageFrame.METRIC]
        raise BadInputError(
            f"{pixel} counts in pixels and {metric} in millimetres from the image centre; import them one by one"
        )
    return next(iter(known), ImageFrame.PIXEL)


def _together(parts: Sequence[Part], kind: str, word: str) -> dict[str, dict[str, Any]]:
    """The entries of all parts; several files may say of one thing what the others leave open.

    Surveyed points replace start values of the same name.

    Raises:
        BadInputError: two files say different things of one, or both have the same camera or surveyed point.
    """
    found: dict[str, dict[str, Any]] = {}
    origin: dict[str, str] = {}
    for part in parts:
        for name, given in getattr(part, kind).items():
            entry = {key: value for key, value in given.items() if value is not None}
            before = found.get(name)
            if before is None or (before.get("role") == "tie" != entry.get("role")):
                found[name], origin[name] = entry, part.source
            elif not (entry.get("role") == "tie" != before.get("role")):
                if kind == "cameras" or entry.get("role", "tie") != "tie" or _contradict(before, entry):
                    raise BadInputError(
                        f"{part.source}: {word} {name!r} is in {origin[name]} too{_apart(before, entry)}; "
                        f"{'rename one of the files' if kind == 'cameras' else 'keep one of them, or rename one'}"
                    )
                found[name] = before | entry
    return found


def _contradict(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    return any(one[key] != other[key] for key in set(one) & set(other))


def _apart(one: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    """By how much the coordinates of two entries differ, in words."""
    for key in ("X", "X0"):
        if key in one and key in other:
            return f", {np.linalg.norm(np.subtract(one[key], other[key])):.4g} apart"
    return ""


def _name_cameras(images: Mapping[str, dict[str, Any]], cameras: Mapping[str, Any]) -> None:
    """Give images without a camera the only one there is."""
    for name, image in images.items():
        if "camera" in image:
            continue
        if len(cameras) != 1:
            raise BadInputError(
                f"nothing says which of {len(cameras)} cameras took image {name!r}; add a file with lines "
                "'image camera', called .eor, or the file with the camera"
            )
        image["camera"] = next(iter(cameras))
