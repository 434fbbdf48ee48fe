"""Reads `svev-network/1` files; one message names everything that is wrong in a file, with place and remedy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from photogrammetry.network.faults import Faults, WrongEntryError
from photogrammetry.network.formats import NETWORK, require_format
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
from photogrammetry.network.strict_text import read_object
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.settings.strict_toml import StrictModel, examine

_Entry = TypeVar("_Entry", bound=StrictModel)

#: From `reweight` in the file to `Network.reweight`.
REWEIGHT = {False: Reweight.NONE, True: Reweight.HELMERT, "paper": Reweight.PAPER}


def read_network(path: Path) -> Network:
    """Read a network file, JSON or TOML.

    Raises:
        BadInputError: missing, unreadable, neither JSON nor TOML, or no network; one line with file, keys and remedies.
    """
    data = read_object(path)
    require_format(data, NETWORK, path)
    return network_from_json(data, str(path))


def network_from_json(data: Mapping[str, Any], source: str) -> Network:
    """Build a network from the file's object.

    Args:
        data: the JSON object.
        source: named in error messages.

    Raises:
        BadInputError: something is missing, unknown, or of the wrong kind; the message names all of it.
    """
    faults = Faults(source)
    entry = _whole(data, faults)
    frame = ImageFrame(entry.image_frame)
    cameras = faults.each(entry.cameras.items(), lambda name, body: _camera(name, body, frame, f"cameras.{name}"))
    camera_index = {name: i for i, name in enumerate(entry.cameras)}
    images = faults.each(entry.images.items(), lambda name, body: _image(name, body, camera_index, f"images.{name}"))
    image_index = {name: i for i, name in enumerate(entry.images)}
    points = faults.each(entry.points.items(), lambda name, body: _point(name, body, f"points.{name}"))
    point_index = {name: i for i, name in enumerate(entry.points)}
    rows = _Rows(image_index, point_index)
    observed = faults.each(enumerate(entry.observations), lambda i, row: rows.read(row, f"observations.{i}", i))
    distances = faults.each(enumerate(entry.distances), lambda i, body: _distance(body, point_index, f"distances.{i}"))
    differences = faults.each(
        enumerate(entry.differences), lambda i, body: _difference(body, point_index, f"differences.{i}")
    )
    (datum,) = faults.each([("datum", entry.datum)], lambda name, body: _datum(body, point_index, name)) or (Datum(),)
    faults.raise_any()
    _refuse_fixed(datum, points, f"{source}: datum")
    return Network(
        cameras=cameras,
        images=images,
        points=points,
        observations=_observations(observed, tuple(rows.groups), cameras, images, frame),
        distances=distances,
        differences=differences,
        datum=datum,
        length_unit=entry.length_unit,
        ball_radius_m=entry.ball_radius_m,
        image_frame=frame,
        sigma0=entry.sigma0,
        reweight=REWEIGHT[entry.reweight],
    )


def _whole(data: Mapping[str, Any], faults: Faults) -> NetworkEntry:
    """The file's keys; where single values are wrong, the search for faults goes on without them."""
    entry, wrong = examine(NetworkEntry, dict(data))
    faults.add(fault.words for fault in wrong)
    if entry is None:
        bad = {fault.place[0] for fault in wrong if fault.place}
        rest = {key: value for key, value in data.items() if key not in bad}
        entry, _ = examine(NetworkEntry, {"format": "svev-network/1", "image_frame": "metric"} | rest)
    if entry is None:
        faults.raise_any()
        raise AssertionError("an entry without a fault")
    return entry


def _entry(model: type[_Entry], body: Any, source: str) -> _Entry:
    """One entry of the file, validated."""
    if not isinstance(body, dict):
        raise WrongEntryError(f"{source}: is no object; write it as {{...}}")
    entry, faults = examine(model, body)
    if entry is None:
        raise WrongEntryError(*(f"{source}: {fault.words}" for fault in faults))
    return entry


def _array(values: Sequence[Any] | None) -> Floats | None:
    return None if values is None else np.array(values, dtype=float)


def _camera(name: str, body: Any, frame: ImageFrame, source: str) -> Camera:
    entry = _entry(CameraEntry, body, source)
    if frame is ImageFrame.PIXEL and entry.size is None:
        raise WrongEntryError(f'{source}: key "size" is missing; the pixel frame needs [width, height]')
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
        raise WrongEntryError(
            f'{source}: {what} {name!r} is not listed under "{what}s"; add it there or correct the name'
        )
    return names[name]


@dataclass(frozen=True, slots=True)
class _Row:
    """One observation: indices of image, point and group; x, y and their sigmas."""

    index: tuple[int, int, int]
    values: tuple[float, float, float, float]


class _Rows:
    """Reads observations one by one; knows which image has which point, and the groups."""

    def __init__(self, images: Mapping[str, int], points: Mapping[str, int]) -> None:
        self._images, self._points = images, points
        self._seen: dict[tuple[int, int], int] = {}
        self.groups: dict[str, int] = {}

    def read(self, row: Any, place: str, number: int) -> _Row:
        """Read the observation with this number."""
        numbers, group = _numbers(row, place)
        image = _known(row[0], self._images, "image", place)
        point = _known(row[1], self._points, "point", place)
        first = self._seen.setdefault((image, point), number)
        if first != number:
            raise WrongEntryError(
                f"{place}: point {row[1]!r} is observed twice in image {row[0]!r} (first in observations.{first}); "
                "keep one of them or their mean"
            )
        x, y, sigma_x, sigma_y = numbers if len(numbers) == 4 else (*numbers, numbers[2])
        return _Row((image, point, self.groups.setdefault(group, len(self.groups))), (x, y, sigma_x, sigma_y))


def _observations(
    rows: Sequence[_Row],
    groups: tuple[str, ...],
    cameras: Sequence[Camera],
    images: Sequence[Image],
    frame: ImageFrame,
) -> ImageObservations:
    index = np.array([row.index for row in rows], dtype=np.intp).reshape(-1, 3)
    values = np.array([row.values for row in rows], dtype=float).reshape(-1, 4)
    if frame is ImageFrame.PIXEL and len(rows):
        size = np.array([cameras[images[image].camera].size for image in index[:, 0]], dtype=float)
        values[:, :2] = pixel_to_metric(values[:, :2], size)
    return ImageObservations(index[:, 0], index[:, 1], values[:, :2], values[:, 2:], index[:, 2], groups or ("image",))


def _numbers(row: Any, place: str) -> tuple[list[float], str]:
    """The numbers of an observation and its group."""
    if not isinstance(row, list) or len(row) < 5:
        raise WrongEntryError(f"{place}: {row!r} is no observation; write [image, point, x, y, sigma]")
    group = row[-1] if isinstance(row[-1], str) else "image"
    numbers = row[2:-1] if isinstance(row[-1], str) else row[2:]
    if len(numbers) not in (3, 4):
        raise WrongEntryError(f"{place}: has {len(numbers)} numbers; write x, y, sigma or x, y, sigma_x, sigma_y")
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, (int, float)) or not abs(number) <= LARGEST:
            raise WrongEntryError(f"{place}: {number!r} is no number in range; correct it")
    if min(numbers[2:]) < SMALLEST:
        raise WrongEntryError(f"{place}: sigma {min(numbers[2:])!r} is not positive; correct it")
    if group in RESERVED_GROUPS:
        raise WrongEntryError(f'{place}: group "{group}" is the name of another kind of observation; choose another')
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
        raise WrongEntryError(f"{source}: goes from {start!r} to itself; name two points")
    return _known(start, points, "point", source), _known(end, points, "point", source)


def _distance(body: Any, points: Mapping[str, int], source: str) -> Distance:
    entry = _entry(DistanceEntry, body, source)
    return Distance(*_ends(entry.start, entry.end, points, source), entry.value, entry.sigma)


def _difference(body: Any, points: Mapping[str, int], source: str) -> Difference:
    entry = _entry(DifferenceEntry, body, source)
    ends = _ends(entry.start, entry.end, points, source)
    return Difference(*ends, AXES.index(entry.axis), entry.value, entry.sigma)


def _datum(body: Any, index: Mapping[str, int], source: str) -> Datum:
    entry = _entry(DatumEntry, body, source)
    if entry.points is None:
        return Datum(DatumType(entry.type))
    if entry.type == "control":
        raise WrongEntryError(f'{source}: "points" belong to an inner datum; set "type": "inner" or drop them')
    return Datum(DatumType.INNER, tuple(dict.fromkeys(_known(name, index, "point", source) for name in entry.points)))


def _refuse_fixed(datum: Datum, points: Sequence[Point], source: str) -> None:
    """Raise BadInputError if a datum point of a free network is fixed."""
    for i in datum.points or ():
        if points[i].role is Role.FIXED:
            raise BadInputError(f"{source}: point {points[i].name!r} is fixed; inner constraints need unknown points")
