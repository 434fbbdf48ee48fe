"""Makes random hills with known truth and spoils them: exchanged names, wrong survey, image points or units."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from photogrammetry.geometry.camera_model import INTERIOR, camera_coordinates, image_point
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.network.model import Camera, Image, ImageFrame, ImageObservations, Network, Point, Role
from photogrammetry.network.selection import only_observations, only_points, rays
from rig.arrays import Floats
from rig.images.viewing import look_at

_SIGMA_PX, _SIGMA_SURVEY_M = 0.33, 0.012
_SIZE = (640, 480)
_SURVEYED, _TIES, _HELMETS = 15, 6, 17
_FEW_POINTS, _FEW_RAYS = 8, (6, 6, 5)  # of the hill that shows little, and of its images
_FAR_M = 10.0  # exchanged points are at least so far apart
_SMALLEST_M, _LARGEST_M = 0.1, 10.0  # errors of the survey
_SMALLEST_PX, _LARGEST_PX = 3.0, 100.0
_FEET, _MILLIMETRES = 1.0 / 0.3048, 1000.0
_GIVEN_M, _GIVEN_RAD = 0.5, 0.01  # how well poses are known where they are given


@dataclass(frozen=True, slots=True, eq=False)
class Hill:
    """A network and the truth behind it.

    Attributes:
        network: three images, 15 surveyed balls, 6 others, 17 places of the helmet; noise by the sigmas.
        positions: (3, 3) true projection centres.
        culprits: names of the wrong observations: points, or "image point".
    """

    network: Network
    positions: Floats
    culprits: tuple[str, ...] = ()


def hill(rng: np.random.Generator, *, helmets: bool = True) -> Hill:
    """A sound hill; neither poses nor tie points are given."""
    places = ((-12.0, -38.0, 4.0), (22.0, -42.0, 8.0), (40.0, -72.0, 10.0))
    positions = np.array(places) + rng.uniform(-3.0, 3.0, (3, 3))
    turns = [look_at(place, np.array((10.0, 0.0, -2.0)) + rng.uniform(-1.0, 1.0, 3)) for place in positions]
    interior = np.zeros((3, len(INTERIOR)))
    interior[:, 0] = 1419.7, 1421.7, 2493.3
    cameras = tuple(Camera(f"K{i + 1}", values, size=_SIZE) for i, values in enumerate(interior))
    balls = rng.uniform((0.0, -4.0, -6.0), (20.0, 6.0, 3.0), (_SURVEYED + _TIES, 3))
    time = np.linspace(0.0, 0.8, _HELMETS if helmets else 0)
    flight = np.column_stack([25.0 * time, 0.2 * np.sin(5.0 * time), 1.5 + 0.5 * time - 4.9 * time**2])
    xyz = np.vstack([balls, flight])
    sigma = np.full(3, _SIGMA_SURVEY_M)
    points = [Point(f"B{j + 1}", Role.CONTROL, xyz[j] + sigma * rng.normal(size=3), sigma) for j in range(_SURVEYED)]
    points += [Point(f"T{j + 1}", Role.TIE) for j in range(_TIES)] + [
        Point(f"H{j + 1}", Role.TIE) for j in range(len(time))
    ]
    rows, xy = [], []
    for i, (camera, place, turn) in enumerate(zip(cameras, positions, turns, strict=True)):
        seen = image_point(camera.lens(), turn, place, xyz)
        there = (camera_coordinates(turn, place, xyz)[:, 2] < 0.0) & (np.abs(seen) < np.array(_SIZE) / 2).all(axis=1)
        rows += [(i, int(j)) for j in np.flatnonzero(there)]
        xy.append(seen[there])
    index, count = np.array(rows, dtype=np.intp), len(rows)
    observations = ImageObservations(
        index[:, 0],
        index[:, 1],
        np.concatenate(xy) + rng.normal(0.0, _SIGMA_PX, (count, 2)),
        np.full((count, 2), _SIGMA_PX),
        np.zeros(count, dtype=np.intp),
    )
    network = Network(
        cameras,
        tuple(Image(f"hill-{i + 1}", i) for i in range(3)),
        tuple(points),
        observations,
        length_unit="m",
        image_frame=ImageFrame.PIXEL,
    )
    return Hill(_seen_only(network), positions)


def _seen_only(network: Network) -> Network:
    """Without tie points that fewer than two images show: nothing determines them."""
    stays = np.array([p.role is Role.CONTROL for p in network.points]) | (rays(network) >= 2)
    return only_points(network, stays)


Spoil = Callable[[Hill, np.random.Generator], Hill]


def with_poses(case: Hill, rng: np.random.Generator) -> Hill:
    """The same with poses given as well as one paces them out."""
    target = np.array((10.0, 0.0, -2.0))
    images = []
    for image, place in zip(case.network.images, case.positions, strict=True):
        turn = look_at(place, target) @ rotation_from_vector(rng.normal(0.0, _GIVEN_RAD, 3))
        images.append(replace(image, position=place + rng.normal(0.0, _GIVEN_M, 3), rotation=turn))
    return replace(case, network=replace(case.network, images=tuple(images)))


def _surveyed(case: Hill, change: Callable[[int, Floats], Floats], culprits: tuple[str, ...] = ()) -> Hill:
    """The same with changed coordinates of the surveyed points: `change(index, xyz)`."""
    points = tuple(
        replace(p, xyz=change(i, np.asarray(p.xyz, float))) if p.role is Role.CONTROL else p
        for i, p in enumerate(case.network.points)
    )
    return replace(case, network=replace(case.network, points=points), culprits=culprits)


def exchanged_names(pairs: int) -> Spoil:
    """Pairs of surveyed points, more than 10 m apart, exchange their coordinates."""

    def spoil(case: Hill, rng: np.random.Generator) -> Hill:
        xyz = [np.asarray(p.xyz, float) for p in case.network.points[:_SURVEYED]]
        order: dict[int, int] = {}
        while len(order) < 2 * pairs:
            i, k = (int(n) for n in rng.choice(_SURVEYED, 2, replace=False))
            if i not in order and k not in order and np.linalg.norm(xyz[i] - xyz[k]) > _FAR_M:
                order |= {i: k, k: i}
        return _surveyed(case, lambda i, _: xyz[order.get(i, i)], tuple(f"B{i + 1}" for i in order))

    return spoil


def wrong_survey(count: int) -> Spoil:
    """Some surveyed points are wrong by 0.1 to 10 m."""

    def spoil(case: Hill, rng: np.random.Generator) -> Hill:
        off = {}
        for i in rng.choice(_SURVEYED, count, replace=False):
            direction = rng.normal(size=3)
            size = np.exp(rng.uniform(np.log(_SMALLEST_M), np.log(_LARGEST_M)))
            off[int(i)] = size * direction / np.linalg.norm(direction)
        return _surveyed(case, lambda i, xyz: xyz + off.get(i, 0.0), tuple(f"B{i + 1}" for i in off))

    return spoil


def other_station(count: int) -> Spoil:
    """Some points were surveyed from a station that is 1 m off."""

    def spoil(case: Hill, rng: np.random.Generator) -> Hill:
        direction = rng.normal(size=3)
        off = direction / np.linalg.norm(direction)
        chosen = {int(i) for i in rng.choice(_SURVEYED, count, replace=False)}
        return _surveyed(case, lambda i, xyz: xyz + (i in chosen) * off, tuple(f"B{i + 1}" for i in chosen))

    return spoil


def few_rays(case: Hill, rng: np.random.Generator) -> Hill:
    """Only eight surveyed points, of which two images show six and one shows five; an image point is wrong."""
    network = only_points(case.network, np.arange(len(case.network.points)) < _FEW_POINTS)
    image = network.observations.image
    kept = np.ones(len(image), bool)
    for i, count in enumerate(_FEW_RAYS):
        kept[rng.permutation(np.flatnonzero(image == i))[count:]] = False
    network = only_observations(network, kept)
    xy = network.observations.xy.copy()
    xy[np.flatnonzero(network.observations.image == 1)[0]] += rng.choice([-1, 1], 2) * rng.uniform(3.0, 6.0, 2)
    return replace(case, network=replace(network, observations=replace(network.observations, xy=xy)))


def other_unit(factor: float, count: int = _SURVEYED) -> Spoil:
    """Some points, or all of them, are given in another unit."""

    def spoil(case: Hill, rng: np.random.Generator) -> Hill:
        chosen = {int(i) for i in rng.choice(_SURVEYED, count, replace=False)}
        return _surveyed(
            case, lambda i, xyz: xyz * (factor if i in chosen else 1.0), tuple(f"B{i + 1}" for i in chosen)
        )

    return spoil


def mirrored(case: Hill, rng: np.random.Generator) -> Hill:
    """One axis of the survey points the other way."""
    axis = int(rng.integers(3))
    return _surveyed(case, lambda _, xyz: xyz * np.where(np.arange(3) == axis, -1.0, 1.0))


def wrong_image_points(count: int) -> Spoil:
    """Some image points are wrong by 3 to 100 px."""

    def spoil(case: Hill, rng: np.random.Generator) -> Hill:
        o = case.network.observations
        xy, chosen = o.xy.copy(), rng.choice(len(o.xy), count, replace=False)
        angle = rng.uniform(0.0, 2.0 * np.pi, count)
        size = np.exp(rng.uniform(np.log(_SMALLEST_PX), np.log(_LARGEST_PX), count))
        xy[chosen] += size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        names = tuple(
            f"{case.network.points[o.point[i]].name} in {case.network.images[o.image[i]].name}" for i in chosen
        )
        return replace(case, network=replace(case.network, observations=replace(o, xy=xy)), culprits=names)

    return spoil


def exchanged_image_points(case: Hill, rng: np.random.Generator) -> Hill:
    """Two points of an image exchange their names."""
    o = case.network.observations
    image = int(rng.integers(3))
    i, k = rng.choice(np.flatnonzero(o.image == image), 2, replace=False)
    xy = o.xy.copy()
    xy[[i, k]] = xy[[k, i]]
    names = tuple(f"{case.network.points[o.point[row]].name} in hill-{image + 1}" for row in (i, k))
    return replace(case, network=replace(case.network, observations=replace(o, xy=xy)), culprits=names)


def exchanged_cameras(case: Hill, rng: np.random.Generator) -> Hill:
    """The images of two cameras exchange their names."""
    i, k = (int(n) for n in rng.choice(3, 2, replace=False))
    o = case.network.observations
    image = np.where(o.image == i, k, np.where(o.image == k, i, o.image))
    return replace(case, network=replace(case.network, observations=replace(o, image=image)))


#: What can be wrong, by name, and whether approximate poses are given.
KINDS: dict[str, tuple[Spoil, bool]] = {
    "sound": (lambda case, _: case, False),
    "1 image point": (wrong_image_points(1), False),
    "2 image points": (wrong_image_points(2), False),
    "3 image points": (wrong_image_points(3), False),
    "2 names exchanged in an image": (exchanged_image_points, False),
    "1 survey point": (wrong_survey(1), False),
    "2 survey points": (wrong_survey(2), False),
    "3 survey points": (wrong_survey(3), False),
    "1 exchange in the survey": (exchanged_names(1), False),
    "2 exchanges in the survey": (exchanged_names(2), False),
    "3 exchanges in the survey": (exchanged_names(3), False),
    "3 points in feet": (other_unit(_FEET, 3), False),
    "3 points in mm": (other_unit(_MILLIMETRES, 3), False),
    "5 points shifted": (other_station(5), False),
    "8 points shifted": (other_station(8), False),
    "mirrored survey": (mirrored, False),
    "survey in feet, poses in m": (other_unit(_FEET), True),
    "survey in mm, poses in m": (other_unit(_MILLIMETRES), True),
    "2 cameras exchanged, poses given": (exchanged_cameras, True),
}
