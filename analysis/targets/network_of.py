"""The network file's object out of pictures of targets: corners are unknown points, of a frame that is only rigid."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.targets.detection import Sight
from analysis.targets.pattern import Layout, target_of
from analysis.targets.start import start_values
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.file import pixel_to_metric
from photogrammetry.network.model import (
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
    Role,
)
from photogrammetry.network.selection import RAYS
from rig.arrays import Floats
from rig.errors import BadInputError

#: Unknowns of each camera. None is left out for being insignificant: the others would make up for it.
ESTIMATE = ("c", "x0", "y0", "a1", "a2", "b1", "b2")
#: What is known of any lens beforehand: sigmas of weighted observations, in terms of the picture's width w. They keep
#: pictures with too little content solvable, so that the verdict can tell what is missing; others they do not touch.
_C, _PRINCIPAL, _RADIAL, _DECENTRING = 0.5, 0.05, 0.1, 0.005  # c: of itself; x0, y0: of w; shifts at w / 2: of w / 2
#: Corners that a picture needs to be worth its six unknowns.
FEWEST_CORNERS = 8
#: A picture is joined to the others by so many corners at least, each of which so many pictures show.
_SHARED, _SHARING = 4, 3
_FLAT_MM = 0.05  # sigma of a corner off the plane of a board that is said to be flat
_OTHER_UNIT = 3.0  # times the nominal distance: prints are not that far off, other units are
_PRINTED = 0.005  # sigma of its length, as part of the nominal one


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A picture: its camera, its name, and what it shows."""

    camera: str
    name: str
    sight: Sight


@dataclass(frozen=True, slots=True)
class MeasuredDistance:
    """A distance (mm) between two corners that a person has measured, and its sigma."""

    start: str
    end: str
    mm: float
    sigma_mm: float


def network_of(
    pictures: Sequence[Picture], layout: Layout, distances: Sequence[MeasuredDistance] = (), *, flat: bool = False
) -> tuple[Network, list[str]]:
    """A network with start values of everything.

    Args:
        pictures: of one frame, with their corners.
        layout: what was printed.
        distances: that give the scale.
        flat: the board is flat: its corners are in one plane.

    Returns:
        The network, and a line for each picture that cannot be used.

    Raises:
        BadInputError: nothing can be made of the pictures, or a distance ends at a corner that is not seen.
    """
    start = start_values([(picture.camera, picture.sight) for picture in pictures], layout)
    notes = [
        f"{picture.name} is left out: its targets cannot be joined to those of the other pictures; take pictures "
        "that show both"
        for k, picture in enumerate(pictures)
        if k not in start.poses
    ]
    used, loose = _joined([(k, picture) for k, picture in enumerate(pictures) if k in start.poses])
    notes += loose
    rays = Counter(name for _, picture in used for name in picture.sight.corners if name in start.places)
    names = sorted(name for name, count in rays.items() if count >= RAYS)
    number = {name: i for i, name in enumerate(names)}
    cameras = list(dict.fromkeys(picture.camera for _, picture in used))
    size = {picture.camera: picture.sight.size for _, picture in used}
    rows = [
        (i, number[name], cameras.index(picture.camera), corner.x, corner.y, corner.sigma_x, corner.sigma_y)
        for i, (_, picture) in enumerate(used)
        for name, corner in picture.sight.corners.items()
        if name in number
    ]
    if not rows:
        raise BadInputError("no corner is in two pictures: take at least six pictures of the same target")
    table = np.array(rows, dtype=float)
    image, point, camera = (table[:, column].astype(np.intp) for column in range(3))
    sizes = np.array([size[name] for name in cameras], dtype=float)
    observed = ImageObservations(
        image, point, pixel_to_metric(table[:, 3:5], sizes[camera]), table[:, 5:7],
        camera if len(cameras) > 1 else np.zeros_like(camera), tuple(cameras) if len(cameras) > 1 else ("image",),
    )  # fmt: skip
    return (
        Network(
            cameras=tuple(_camera(name, start.c[name], size[name]) for name in cameras),
            images=tuple(Image(picture.name, cameras.index(picture.camera), *start.poses[k]) for k, picture in used),
            points=tuple(Point(name, Role.TIE, start.places[name]) for name in names),
            observations=observed,
            distances=tuple(_distance(each, number, start.places) for each in distances)
            or (_nominal(names, layout) if flat else ()),
            differences=_plane(names) if flat else (),
            datum=Datum(DatumType.INNER),
            length_unit="mm",
            image_frame=ImageFrame.PIXEL,
        ),
        notes,
    )


def _joined(used: list[tuple[int, Picture]]) -> tuple[list[tuple[int, Picture]], list[str]]:
    """The pictures without those that share their targets with one other picture alone, and a line for each of those.

    Two pictures tell directions of what only they show, and no size: how far away it is stays undetermined.
    """
    notes: list[str] = []
    while len(used) > _SHARING:
        rays = Counter(name for _, picture in used for name in picture.sight.corners)
        shared = [sum(rays[name] >= _SHARING for name in picture.sight.corners) for _, picture in used]
        worst = min(range(len(used)), key=lambda i: shared[i])
        if shared[worst] >= _SHARED:
            break
        notes.append(
            f"{used[worst][1].name} is left out: no two other pictures show its targets; show the same targets in more "
            "pictures"
        )
        used = [*used[:worst], *used[worst + 1 :]]
    return used, notes


def _camera(name: str, c: float, size: tuple[int, int]) -> Camera:
    """A camera of which little is known."""
    interior = np.zeros(len(INTERIOR))
    interior[0] = c
    half = size[0] / 2.0
    sigma = {
        "c": _C * c,
        **dict.fromkeys(("x0", "y0"), _PRINCIPAL * size[0]),
        "a1": _RADIAL / half**2,
        "a2": _RADIAL / half**4,
        **dict.fromkeys(("b1", "b2"), _DECENTRING / half),
    }
    return Camera(name, interior, size=size, estimate=ESTIMATE, sigma=sigma)


def _distance(measured: MeasuredDistance, number: Mapping[str, int], places: Mapping[str, Floats]) -> Distance:
    for end in (measured.start, measured.end):
        if end not in number:
            raise BadInputError(f"--distance: corner {end} is in fewer than two pictures; name corners that are seen")
    about = float(np.linalg.norm(places[measured.start] - places[measured.end]))
    if not 1.0 / _OTHER_UNIT < measured.mm / about < _OTHER_UNIT:
        raise BadInputError(
            f"--distance: {measured.start} and {measured.end} are about {about:.0f} mm apart by the nominal size of "
            f"the targets, not {measured.mm:g}; give it in mm, and --square-mm and --target-mm as the prints have them"
        )
    return Distance(number[measured.start], number[measured.end], measured.mm, measured.sigma_mm)


def _nominal(names: Sequence[str], layout: Layout) -> tuple[Distance, ...]:
    """The board's nominal size: how flat it is, in mm, means nothing without a scale."""
    places = {i: place for i, name in enumerate(names) if (place := layout.board_place(name)) is not None}
    if not places:
        raise BadInputError("--flat: no picture shows a board; leave it out")
    first = min(places, key=lambda i: float(places[i][0] - places[i][1]))
    last = max(places, key=lambda i: float(places[i][0] - places[i][1]))
    length = float(np.linalg.norm(places[last] - places[first]))
    return (Distance(first, last, length, _PRINTED * length),)


def _plane(names: Sequence[str]) -> tuple[Difference, ...]:
    """Height differences of the board's corners to its first one."""
    board = [i for i, name in enumerate(names) if target_of(name) == "board"]
    return tuple(Difference(board[0], i, 2, 0.0, _FLAT_MM) for i in board[1:])
