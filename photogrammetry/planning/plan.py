"""Makes a network out of a description: observes every target in every image that shows it, without error."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.model import (
    AXES,
    Camera,
    Datum,
    DatumType,
    Difference,
    Distance,
    Image,
    ImageObservations,
    Network,
    Point,
    Role,
)
from photogrammetry.planning.description import Description, JumperEntry
from photogrammetry.planning.sight import Obstacle, in_picture, in_sight
from rig.arrays import Floats, Integers
from rig.errors import BadInputError
from rig.images.viewing import look_at


@dataclass(frozen=True, slots=True)
class Stick:
    """The stick model of Fig. 6 by indices of the flight's points and skis; pairs are right, left."""

    helmet: int
    hip: int
    bindings: tuple[int, int]
    skis: tuple[int, int]
    rate_hz: float


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """The jumper's points and skis that step 3 intersects, true values.

    Attributes:
        points: (t, p, 3) jumper points at t positions.
        names: of the p points.
        tie: (t, p) index of the same point in the network of step 2; -1: it is no tie point there.
        skis: (t, s, k, 3) measured points of s skis.
        ski_names: of the s skis.
        stick: definition of the body angles; None: they are not predicted.
    """

    points: Floats
    names: tuple[str, ...]
    tie: Integers
    skis: Floats
    ski_names: tuple[str, ...]
    stick: Stick | None


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A planned network.

    Attributes:
        name: for people.
        network: step 2 (or the laboratory's step 1): true values, error-free observations.
        sigma: of an image coordinate (px).
        flight: step 3; None without a jumper.
        obstacles: what hides targets and jumper.
    """

    name: str
    network: Network
    sigma: float
    flight: Flight | None
    obstacles: tuple[Obstacle, ...] = ()


def plan_from(description: Description) -> Plan:
    """The planned network with the observations of all images.

    Raises:
        BadInputError: a jumper point or ski that fewer than two images show.
    """
    cameras = tuple(_camera(entry.name, entry.c, entry.size, entry.estimate) for entry in description.cameras)
    images = tuple(
        Image(f"{entry.name}-{number}", index, np.array(image.X0), look_at(image.X0, image.look_at, image.roll_deg))
        for index, entry in enumerate(description.cameras)
        for number, image in enumerate(entry.images, 1)
    )
    obstacles = tuple(
        Obstacle(each.name, np.minimum(each.corner, each.opposite), np.maximum(each.corner, each.opposite))
        for each in description.obstacles
    )
    points, distances, differences = _targets(description)
    flight = _flight(description, len(points))
    if flight is not None:
        _check_flight(flight, cameras, images, obstacles)
        for position, name in np.argwhere(flight.tie >= 0):
            points.append(Point(f"{flight.names[name]} at {position + 1}", Role.TIE, flight.points[position, name]))
    network = Network(
        cameras,
        images,
        tuple(points),
        _observations(cameras, images, points, description.sigma.image, obstacles),
        tuple(distances),
        tuple(differences),
        Datum(DatumType(description.datum)),
        description.length_unit,
    )
    return Plan(description.name, network, description.sigma.image, flight, obstacles)


def hidden(plan: Plan) -> dict[str, list[str]]:
    """What obstacles hide: names of targets, jumper points and skis (with their position) by image."""
    found: dict[str, list[str]] = {}
    network, flight = plan.network, plan.flight
    moving = set() if flight is None else set(flight.tie.ravel().tolist())
    places = [(point.name, np.asarray(point.xyz)) for i, point in enumerate(network.points) if i not in moving]
    for names, xyz in () if flight is None else ((flight.names, flight.points), (flight.ski_names, flight.skis)):
        places += [(f"{name} at {t + 1}", xyz[t, i]) for t in range(len(xyz)) for i, name in enumerate(names)]
    for image in network.images if plan.obstacles else ():
        camera = network.cameras[image.camera]
        for name, xyz in places:
            shown = in_picture(camera, image, xyz)[1]
            if np.any(shown & ~in_sight(plan.obstacles, camera, image, xyz)[1]):
                found.setdefault(image.name, []).append(name)
    return found


def _camera(name: str, c: float, size: list[int], estimate: Sequence[str]) -> Camera:
    interior = np.zeros(len(INTERIOR))
    interior[0] = c
    chosen = tuple(parameter for parameter in INTERIOR if parameter in estimate)
    return Camera(name, interior, size=(size[0], size[1]), estimate=chosen)


def _targets(description: Description) -> tuple[list[Point], list[Distance], list[Difference]]:
    """Balls and rods as points, distances and differences."""
    sigma, index = description.sigma, {name: i for i, name in enumerate(description.target_names())}
    points = [
        Point(
            ball.name,
            Role(ball.role),
            np.array(ball.X),
            np.full(3, sigma.control) if ball.role == "control" and sigma.control is not None else None,
        )
        for ball in description.balls
    ]
    distances, differences = [], []
    for rod in description.rods:
        if sigma.rod_length is None or sigma.rod_verticality is None:  # `Description` refuses it
            raise ValueError("rods without sigmas")
        foot, start = np.array(rod.foot), len(points)
        points += [
            Point(f"{rod.name}-1", Role.TIE, foot),
            Point(f"{rod.name}-2", Role.TIE, foot + np.array((0.0, 0.0, rod.length))),
        ]
        distances.append(Distance(start, start + 1, rod.length, sigma.rod_length))
        across = sigma.rod_verticality * rod.length
        differences += [Difference(start, start + 1, axis, 0.0, across) for axis in (0, 1)]
    for entry in description.differences:
        start, end, axis = index[entry.start], index[entry.end], AXES.index(entry.axis)
        here, there = points[start].xyz, points[end].xyz
        if here is not None and there is not None:
            differences.append(Difference(start, end, axis, float(there[axis] - here[axis]), entry.sigma))
    return points, distances, differences


def _flight(description: Description, first_tie: int) -> Flight | None:
    jumper = description.jumper
    if jumper is None:
        return None
    path, names = np.array(jumper.path), tuple(jumper.points)
    points = path[:, None] + np.array(list(jumper.points.values()))
    is_tie = np.tile([name in jumper.tie for name in names], (len(path), 1))
    tie = np.full(is_tie.shape, -1, dtype=np.intp)
    tie[is_tie] = first_tie + np.arange(int(is_tie.sum()))
    along = np.linspace(-0.5, 0.5, jumper.ski_points)
    skis = np.empty((len(path), len(jumper.skis), jumper.ski_points, 3))
    for i, ski in enumerate(jumper.skis.values()):
        direction = np.array(ski.direction) / np.linalg.norm(ski.direction)
        middle = points[:, names.index(ski.point)]
        skis[:, i] = middle[:, None] + ski.length * along[:, None] * direction
    return Flight(points, names, tie, skis, tuple(jumper.skis), _stick(jumper))


def _stick(jumper: JumperEntry) -> Stick | None:
    if jumper.stick is None:
        return None
    points, skis = list(jumper.points), list(jumper.skis)
    right, left = (points.index(jumper.skis[name].point) for name in (jumper.stick.right, jumper.stick.left))
    chosen = skis.index(jumper.stick.right), skis.index(jumper.stick.left)
    return Stick(
        points.index(jumper.stick.helmet), points.index(jumper.stick.hip), (right, left), chosen, jumper.rate_hz
    )


def _check_flight(
    flight: Flight, cameras: tuple[Camera, ...], images: tuple[Image, ...], obstacles: tuple[Obstacle, ...]
) -> None:
    """Raise BadInputError unless two images show every point, and two images every ski as a whole."""
    for names, xyz in ((flight.names, flight.points[:, :, None]), (flight.ski_names, flight.skis)):
        seen = np.sum(
            [in_sight(obstacles, cameras[image.camera], image, xyz)[1].all(axis=-1) for image in images], axis=0
        )
        for position, which in np.argwhere(seen < 2):
            raise BadInputError(
                f"{names[which]} at position {position + 1} of the path is in {seen[position, which]} images; "
                "aim the cameras so that two see it, or shorten the path; obstacles may hide it"
            )


def _observations(
    cameras: tuple[Camera, ...],
    images: tuple[Image, ...],
    points: list[Point],
    sigma: float,
    obstacles: tuple[Obstacle, ...],
) -> ImageObservations:
    xyz = np.array([point.xyz for point in points], dtype=float).reshape(-1, 3)
    shown = [in_sight(obstacles, cameras[image.camera], image, xyz) for image in images]
    where = [(i, p) for i, (_, seen) in enumerate(shown) for p in np.flatnonzero(seen)]
    xy = np.array([shown[i][0][p] for i, p in where]).reshape(-1, 2)
    image, point = (np.array([pair[k] for pair in where], dtype=np.intp) for k in (0, 1))
    return ImageObservations(image, point, xy, np.full(xy.shape, sigma), np.zeros(len(xy), dtype=np.intp))
