"""Seeded synthetic networks with known truth: the paper's laboratory frame, hill and rods.

The paper does not print its coordinates; these follow from its text: principal distances of Table 1, 640 x 480 px, all
cameras on the same side of the flight, at distances that let each view cover its first 20 m. Lengths are in metres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from photogrammetry.adjustment.equations.problem import build_problem
from photogrammetry.adjustment.equations.unknowns import State, number_unknowns, state_of
from photogrammetry.geometry.camera_model import INTERIOR, camera_coordinates, image_point
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
from rig.arrays import Floats
from rig.images.viewing import look_at

SIZE = (640, 480)
SIGMA_PX = 0.33
SIGMA_CONTROL = 0.012
FREE = Datum(DatumType.INNER)


@dataclass(frozen=True, slots=True, eq=False)
class Synthetic:
    """A network with noisy observations and disturbed start values, and the truth."""

    network: Network
    truth: State


def with_state(network: Network, state: State) -> Network:
    """The network with the values of a state, for instance as start values of another adjustment."""
    return replace(
        network,
        cameras=tuple(replace(c, interior=v) for c, v in zip(network.cameras, state.interior, strict=True)),
        images=tuple(
            replace(image, position=x, rotation=r)
            for image, x, r in zip(network.images, state.position, state.rotation, strict=True)
        ),
        points=tuple(replace(point, xyz=x) for point, x in zip(network.points, state.xyz, strict=True)),
    )


def camera(name: str, c: float, estimate: Sequence[str] = (), a1: float = 0.0, x0: float = 0.0) -> Camera:
    """A VGA camera."""
    interior = np.zeros(10)
    interior[[0, 1, 3]] = c, x0, a1
    return Camera(name, interior, size=SIZE, estimate=tuple(p for p in INTERIOR if p in estimate))


def observed(network: Network, sigma: float = SIGMA_PX) -> Network:
    """The network with an exact observation of every point in every image that shows it."""
    rows, xys = [], []
    for i, image in enumerate(network.images):
        lens = network.cameras[image.camera].lens()
        for j, point in enumerate(network.points):
            assert point.xyz is not None
            assert image.rotation is not None
            assert image.position is not None
            xy = image_point(lens, image.rotation, image.position, point.xyz)
            depth = camera_coordinates(image.rotation, image.position, point.xyz)[2]
            if depth < 0.0 and abs(xy[0]) < SIZE[0] / 2 and abs(xy[1]) < SIZE[1] / 2:
                rows.append((i, j))
                xys.append(xy)
    index = np.array(rows, dtype=np.intp).reshape(-1, 2)
    n = len(index)
    return replace(
        network,
        observations=ImageObservations(
            index[:, 0],
            index[:, 1],
            np.array(xys, dtype=float).reshape(-1, 2),
            np.full((n, 2), sigma),
            np.zeros(n, dtype=np.intp),
        ),
    )


def with_noise(network: Network, rng: np.random.Generator, scale: float = 1.0) -> Network:
    """The network with all observations disturbed by their sigmas (times `scale`)."""
    o = network.observations
    noisy = replace(o, xy=o.xy + scale * o.sigma * rng.normal(size=o.xy.shape))
    points = tuple(
        replace(p, xyz=p.xyz + scale * p.sigma * rng.normal(size=3)) if p.sigma is not None and p.xyz is not None else p
        for p in network.points
    )
    return replace(
        network,
        observations=noisy,
        points=points,
        distances=tuple(replace(d, value=d.value + scale * d.sigma * rng.normal()) for d in network.distances),
        differences=tuple(replace(d, value=d.value + scale * d.sigma * rng.normal()) for d in network.differences),
    )


def disturbed(network: Network, rng: np.random.Generator, length: float, angle: float = 0.01) -> State:
    """Start values: the network's values, disturbed where they are unknown."""
    unknowns, state = number_unknowns(network), state_of(network)
    step = np.zeros(unknowns.count + 1)
    step[unknowns.pose[:, :3]] = rng.normal(0.0, length, (len(network.images), 3))
    step[unknowns.pose[:, 3:]] = rng.normal(0.0, angle, (len(network.images), 3))
    step[unknowns.point] = rng.normal(0.0, length, (len(network.points), 3))
    return unknowns.moved(state, step[:-1])


def synthetic(exact: Network, seed: int, length: float, noise: float = 1.0) -> Synthetic:
    """A network with noisy observations and disturbed start values of all unknowns."""
    rng = np.random.default_rng(seed)
    truth = state_of(exact)
    noisy = with_noise(exact, rng, noise)
    start = disturbed(exact, rng, length)
    started = with_state(noisy, start)
    # control, check and fixed points keep their given coordinates: those are observations
    points = tuple(
        new if new.role is Role.TIE else given for new, given in zip(started.points, noisy.points, strict=True)
    )
    return Synthetic(replace(started, points=points), truth)


def empty_observations() -> ImageObservations:
    """No image observations."""
    none = np.zeros(0, dtype=np.intp)
    return ImageObservations(none, none, np.zeros((0, 2)), np.zeros((0, 2)), none)


def lab_frame(seed: int = 1, points: int = 60, noise: float = 1.0) -> Synthetic:
    """Fig. 5: nine images by three cameras around a frame of 0.5 x 0.5 x 0.3 m; all unknown, inner constraints."""
    rng = np.random.default_rng(1000 + seed)
    chosen = ("c", "x0", "y0", "a1")
    cameras = (
        camera("K1", 1420.0, chosen, a1=2e-8, x0=4.0),
        camera("K2", 1422.0, chosen, a1=-1e-8, x0=-3.0),
        camera("K3", 2493.0, chosen, a1=1e-8, x0=6.0),
    )
    images = []
    for i in range(9):
        which, turn = i % 3, i // 3
        distance = 4.0 if which == 2 else 2.0
        azimuth = np.radians((-55.0, 0.0, 55.0)[turn] + 10.0 * (which - 1))
        height = distance * (0.2, 0.6, -0.3)[(turn + which) % 3]
        reach = np.sqrt(distance**2 - height**2)
        position = np.array([reach * np.sin(azimuth), -reach * np.cos(azimuth), height])
        rotation = look_at(position, (0.0, 0.0, 0.0), (0.0, -90.0, -180.0)[turn])
        images.append(Image(f"lab-{i + 1:02d}", which, position, rotation))
    places = rng.uniform(-0.5, 0.5, (points, 3)) * (0.5, 0.5, 0.3)
    network = Network(
        cameras=cameras,
        images=tuple(images),
        points=tuple(Point(f"F{j + 1}", Role.TIE, xyz) for j, xyz in enumerate(places)),
        observations=empty_observations(),
        datum=FREE,
        length_unit="m",
        image_frame=ImageFrame.PIXEL,
    )
    return synthetic(observed(network, 0.18), seed, 0.01, noise)


def hill_images() -> tuple[Image, ...]:
    """Three cameras on the same side of the first 20 m of flight."""
    target = (10.0, 0.0, -2.0)
    places = ((-12.0, -38.0, 4.0), (22.0, -42.0, 8.0), (40.0, -72.0, 10.0))
    return tuple(Image(f"hill-{i + 1}", i, np.array(place), look_at(place, target)) for i, place in enumerate(places))


def flight(count: int = 17) -> Floats:
    """Helmet positions along the flight, (count, 3)."""
    t = np.linspace(0.0, 0.8, count)
    return np.column_stack([25.0 * t, 0.2 * np.sin(5.0 * t), 1.5 + 0.5 * t - 4.9 * t**2])


def hill(seed: int = 1, noise: float = 1.0, helmets: int = 0) -> Synthetic:
    """Fig. 7: 15 reference and 6 tie points (and helmet positions: alternative 2), interior orientation constant."""
    rng = np.random.default_rng(2000 + seed)
    places = np.column_stack([rng.uniform(0, 20, 21), rng.uniform(-4, 6, 21), rng.uniform(-6, 3, 21)])
    points = [
        Point(f"B{j + 1}", Role.CONTROL, xyz, np.full(3, SIGMA_CONTROL))
        if j < 15
        else Point(f"T{j - 14}", Role.TIE, xyz)
        for j, xyz in enumerate(places)
    ]
    points += [Point(f"H{j + 1}", Role.TIE, xyz) for j, xyz in enumerate(flight(helmets))] if helmets else []
    network = Network(
        cameras=(camera("K1", 1419.7), camera("K2", 1421.7), camera("K3", 2493.3)),
        images=hill_images(),
        points=tuple(points),
        observations=empty_observations(),
        length_unit="m",
        image_frame=ImageFrame.PIXEL,
    )
    return synthetic(observed(network), seed, 0.1, noise)


def rods(seed: int = 1, noise: float = 1.0) -> Synthetic:
    """Fig. 9: four positions of a vertical rod of 2 m, the point P0 as origin, helmets as tie points; c and a1 unknown.

    The rods' feet stand in the plane Y = const of P0 (first and third), which gives the direction of X.
    """
    feet = np.array([[1.0, 0.0, -3.0], [7.0, 2.5, -4.5], [13.0, 0.0, -6.0], [19.0, -2.5, -7.0]])
    points = [Point("P0", Role.FIXED, np.zeros(3))]
    distances, differences = [], []
    for i, foot in enumerate(feet):
        low = len(points)
        points += [Point(f"P{i + 1}1", Role.TIE, foot), Point(f"P{i + 1}2", Role.TIE, foot + np.array([0.0, 0.0, 2.0]))]
        distances.append(Distance(low, low + 1, 2.0, 0.001))
        differences += [Difference(low, low + 1, axis, 0.0, 0.02) for axis in (0, 1)]
    differences += [Difference(0, 1, 1, 0.0, 0.02), Difference(0, 5, 1, 0.0, 0.02)]
    points += [Point(f"H{j + 1}", Role.TIE, xyz) for j, xyz in enumerate(flight())]
    network = Network(
        cameras=(
            camera("K1", 1419.7, ("c", "a1"), a1=1e-8),
            camera("K2", 1421.7, ("c", "a1"), a1=1e-8),
            camera("K3", 2493.3, ("c", "a1")),
        ),
        images=hill_images(),
        points=tuple(points),
        observations=empty_observations(),
        distances=tuple(distances),
        differences=tuple(differences),
        length_unit="m",
        image_frame=ImageFrame.PIXEL,
    )
    return synthetic(observed(network), seed, 0.05, noise)


def square_sum(network: Network, state: State) -> float:
    """The square sum that the adjustment minimises, in units of the a-priori variances."""
    return build_problem(network).square_sum(state)
