"""Reads `svev-network/1` files; every error names file, key and remedy."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from photogrammetry.geometry.camera_model import INTERIOR, Distortion
from photogrammetry.geometry.rotation import nearest_rotation
from photogrammetry.network.entries import (
    LARGEST,
    SMALLEST,
    CameraEntry,
    DatumEntry,
    DifferenceEntry,
    DistanceEntry,
    ImageEntry,
    NetworkEntry,
    PointEntry,
)
from photogrammetry.network.model import (
    AXES,
    RESERVED_GROUPS,
    Camera,
    Datum,
    DatumType,
    Difference,
    Distance,
    Image,
    ImageFrame,
    ImageObservations,
    Network,
    Point,
    Reweight,
    Role,
)
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.settings.strict_toml import StrictModel, read_text, validate

_Entry = TypeVar("_Entry", bound=StrictModel)

#: From `reweight` in the file to `Network.reweight`.
REWEIGHT = {False: Reweight.NONE, True: Reweight.HELMERT, "paper": Reweight.PAPER}
_DIGITS = 30  # of a whole number, at most


def read_network(path: Path) -> Network:
    """Read a network file.

    Raises:
        BadInputError: missing, unreadable, not JSON, or no network; one line with file, key and remedy.
    """
    return network_from_json(read_json(path), str(path))


def read_json(path: Path, kind: str = "network file") -> dict[str, Any]:
    """Read one JSON object, strictly: no key twice, no NaN or Infinity.

    Args:
        path: of the file.
        kind: what the file should be, for messages.

    Raises:
        BadInputError: missing, unreadable, not UTF-8, not JSON, not an object.
    """
    try:
        data = json.loads(
            read_text(path, "JSON", f"an existing {kind}"),
            object_pairs_hook=_no_key_twice,
            parse_constant=_no_constant,
            parse_int=_whole_number,
        )
        json.dumps(data, ensure_ascii=False).encode("utf-8")  # refuses escapes of half a surrogate pair
    except UnicodeEncodeError as error:
        raise BadInputError(f"{path}: half a character ({error.object[error.start]!r}); write it whole") from None
    except (json.JSONDecodeError, RecursionError) as error:
        raise BadInputError(f"{path}: not valid JSON: {error}; correct it there") from None
    except _RefusedError as error:
        raise BadInputError(f"{path}: {error}") from None
    if not isinstance(data, dict):
        raise BadInputError(f"{path}: is no JSON object; a {kind} starts with {{")
    return data


class _RefusedError(Exception):
    """Valid JSON that a network file must not contain."""


def _no_key_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise _RefusedError(f'key "{twice}" stands twice in one object; remove or rename one')
    return table


def _no_constant(text: str) -> float:
    raise _RefusedError(f"{text} is no number; write a finite one or null")


def _whole_number(text: str) -> int:
    if len(text) > _DIGITS:
        raise _RefusedError(f"{text[:_DIGITS]}... has too many digits; write it as a decimal number")
    return int(text)


def network_from_json(data: Mapping[str, Any], source: str) -> Network:
    """Build a network from the file's object.

    Args:
        data: the JSON object.
        source: named in error messages.

    Raises:
        BadInputError: something is missing, unknown, or of the wrong kind.
    """
    entry = validate(NetworkEntry, dict(data), source)
    frame = ImageFrame(entry.image_frame)
    cameras = tuple(_camera(name, body, frame, f"{source}: cameras.{name}") for name, body in entry.cameras.items())
    camera_index = {camera.name: i for i, camera in enumerate(cameras)}
    images = tuple(_image(name, body, camera_index, f"{source}: images.{name}") for name, body in entry.images.items())
    points = tuple(_point(name, body, f"{source}: points.{name}") for name, body in entry.points.items())
    point_index = {point.name: i for i, point in enumerate(points)}
    return Network(
        cameras=cameras,
        images=images,
        points=points,
        observations=_observations(entry.observations, cameras, images, point_index, frame, source),
        distances=tuple(
            _distance(body, point_index, f"{source}: distances.{i}") for i, body in enumerate(entry.distances)
        ),
        differences=tuple(
            _difference(body, point_index, f"{source}: differences.{i}") for i, body in enumerate(entry.differences)
        ),
        datum=_datum(entry.datum, point_index, points, f"{source}: datum"),
        length_unit=entry.length_unit,
        image_frame=frame,
        sigma0=entry.sigma0,
        reweight=REWEIGHT[entry.reweight],
    )


def _entry(model: type[_Entry], body: Any, source: str) -> _Entry:
    """One entry of the file, validated."""
    if not isinstance(body, dict):
        raise BadInputError(f"{source}: is no object; write it as {{...}}")
    return validate(model, body, source)


def _array(values: Sequence[Any] | None) -> Floats | None:
    return None if values is None else np.array(values, dtype=float)


def _camera(name: str, body: Any, frame: ImageFrame, source: str) -> Camera:
    entry = _entry(CameraEntry, body, source)
    if frame is ImageFrame.PIXEL and entry.size is None:
        raise BadInputError(f'{source}: key "size" is missing; the pixel frame needs [width, height]')
    return Camera(
        name=name,
        interior=np.array([getattr(entry, parameter) for parameter in INTERIOR], dtype=float),
        balance=entry.r0,
        distortion=Distortion(entry.distortion),
        size=None if entry.size is None else (entry.size[0], entry.size[1]),
        estimate=tuple(parameter for parameter in INTERIOR if parameter in entry.estimate),
        sigma=dict(entry.sigma),
    )


def _image(name: str, body: Any, cameras: Mapping[str, int], source: str) -> Image:
    entry = _entry(ImageEntry, body, source)
    sigma = entry.sigma
    return Image(
        name=name,
        camera=_known(entry.camera, cameras, "camera", source),
        position=_array(entry.X0),
        rotation=nearest_rotation(np.array(entry.R, dtype=float)) if entry.R is not None else None,
        estimate=entry.estimate,
        sigma_position=_array(sigma.X0) if sigma else None,
        sigma_angles=_array(sigma.angles) if sigma else None,
    )


def _point(name: str, body: Any, source: str) -> Point:
    entry = _entry(PointEntry, body, source)
    return Point(name, Role(entry.role), _array(entry.X), _array(entry.sigma))


def _known(name: Any, names: Mapping[str, int], what: str, source: str) -> int:
    if not isinstance(name, str) or name not in names:
        raise BadInputError(
            f'{source}: {what} {name!r} is not listed under "{what}s"; add it there or correct the name'
        )
    return names[name]


def _observations(
    rows: Sequence[Any],
    cameras: Sequence[Camera],
    images: Sequence[Image],
    points: Mapping[str, int],
    frame: ImageFrame,
    source: str,
) -> ImageObservations:
    image_index = {image.name: i for i, image in enumerate(images)}
    groups: dict[str, int] = {}
    index = np.empty((len(rows), 3), dtype=np.intp)
    values = np.empty((len(rows), 4))
    seen: dict[tuple[int, int], int] = {}
    for i, row in enumerate(rows):
        place = f"{source}: observations.{i}"
        numbers, group = _numbers(row, place)
        image = _known(row[0], image_index, "image", place)
        point = _known(row[1], points, "point", place)
        first = seen.setdefault((image, point), i)
        if first != i:
            raise BadInputError(
                f"{place}: point {row[1]!r} is observed twice in image {row[0]!r} (first in observations.{first}); "
                "keep one of them or their mean"
            )
        index[i] = image, point, groups.setdefault(group, len(groups))
        values[i] = numbers if len(numbers) == 4 else (*numbers, numbers[2])
    if frame is ImageFrame.PIXEL and len(rows):
        size = np.array([cameras[images[image].camera].size for image in index[:, 0]], dtype=float)
        values[:, :2] = pixel_to_metric(values[:, :2], size)
    names = tuple(groups) or ("image",)
    return ImageObservations(index[:, 0], index[:, 1], values[:, :2], values[:, 2:], index[:, 2], names)


def _numbers(row: Any, place: str) -> tuple[list[float], str]:
    """The numbers of an observation and its group."""
    if not isinstance(row, list) or len(row) < 5:
        raise BadInputError(f"{place}: {row!r} is no observation; write [image, point, x, y, sigma]")
    group = row[-1] if isinstance(row[-1], str) else "image"
    numbers = row[2:-1] if isinstance(row[-1], str) else row[2:]
    if len(numbers) not in (3, 4):
        raise BadInputError(f"{place}: has {len(numbers)} numbers; write x, y, sigma or x, y, sigma_x, sigma_y")
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not abs(number) <= LARGEST:
            raise BadInputError(f"{place}: {number!r} is no number in range; correct it")
    if min(numbers[2:]) < SMALLEST:
        raise BadInputError(f"{place}: sigma {min(numbers[2:])!r} is not positive; correct it")
    if group in RESERVED_GROUPS:
        raise BadInputError(f'{place}: group "{group}" is the name of another kind of observation; choose another')
    return numbers, group


def pixel_to_metric(xy: Floats, size: Floats) -> Floats:
    """Pixel frame (y down, origin at the centre of the first pixel) to metric frame.

    Args:
        xy: (n, 2) pixel coordinates.
        size: (n, 2) or (2,), width and height.

    Returns:
        (n, 2) metric coordinates, px.
    """
    middle = (np.asarray(size) - 1.0) / 2.0
    return (xy - middle) * (1.0, -1.0)


def _ends(start: str, end: str, points: Mapping[str, int], source: str) -> tuple[int, int]:
    if start == end:
        raise BadInputError(f"{source}: goes from {start!r} to itself; name two points")
    return _known(start, points, "point", source), _known(end, points, "point", source)


def _distance(body: Any, points: Mapping[str, int], source: str) -> Distance:
    entry = _entry(DistanceEntry, body, source)
    return Distance(*_ends(entry.start, entry.end, points, source), entry.value, entry.sigma)


def _difference(body: Any, points: Mapping[str, int], source: str) -> Difference:
    entry = _entry(DifferenceEntry, body, source)
    ends = _ends(entry.start, entry.end, points, source)
    return Difference(*ends, AXES.index(entry.axis), entry.value, entry.sigma)


def _datum(body: Any, index: Mapping[str, int], points: Sequence[Point], source: str) -> Datum:
    entry = _entry(DatumEntry, body, source)
    if entry.points is None:
        return Datum(DatumType(entry.type))
    if entry.type == "control":
        raise BadInputError(f'{source}: "points" belong to an inner datum; set "type": "inner" or drop them')
    chosen = tuple(dict.fromkeys(_known(name, index, "point", source) for name in entry.points))
    for i in chosen:
        if points[i].role is Role.FIXED:
            raise BadInputError(f"{source}: point {points[i].name!r} is fixed; inner constraints need unknown points")
    return Datum(DatumType.INNER, chosen)
