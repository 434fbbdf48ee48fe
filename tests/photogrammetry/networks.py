"""Networks of the paper with known truth; poses and tie points are not given to the adjustment."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.network.model import (
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
from rig.arrays import Flags, Floats
from rig.images.viewing import look_at
from tests.photogrammetry.scenes import flight_points, frame_points, hill_cameras, lab_cameras, observe


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A network and the truth behind it."""

    network: Network
    cameras: list[IdealCamera]  # one per image
    xyz: Floats

    def with_c(self, factors: Sequence[float]) -> "Case":
        """The same case with the given principal distances wrong by these factors."""
        cameras = tuple(
            replace(camera, interior=np.array([camera.interior[0] * factor, *camera.interior[1:]]))
            for camera, factor in zip(self.network.cameras, factors, strict=True)
        )
        return replace(self, network=replace(self.network, cameras=cameras))


def camera(name: str, c: float, estimate: tuple[str, ...]) -> Camera:
    return Camera(name, np.array([c, *[0.0] * 9]), size=(640, 480), estimate=estimate)


def observations(xy: Floats, sigma: float, seen: Flags | None = None) -> ImageObservations:
    """From (n, m, 2) coordinates of n points in m images."""
    n, m = xy.shape[:2]
    points, images = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    there = np.ones((n, m), bool) if seen is None else seen
    count = int(there.sum())
    return ImageObservations(
        images[there].astype(np.intp),
        points[there].astype(np.intp),
        xy[there],
        np.full((count, 2), sigma),
        np.zeros(count, np.intp),
    )


def ties(names: str, count: int) -> list[Point]:
    return [Point(f"{names}{i + 1}", Role.TIE) for i in range(count)]


def laboratory(rng: np.random.Generator, estimate: tuple[str, ...] = ("c", "x0", "y0"), sigma: float = 0.18) -> Case:
    """Step 1, Fig. 5: nine images of a frame with 60 targets, free network."""
    cameras = lab_cameras(rng)
    xyz = frame_points(rng)
    network = Network(
        tuple(camera(f"K{i + 1}", cameras[3 * i].c, estimate) for i in range(3)),
        tuple(Image(f"lab-{i + 1}", i // 3) for i in range(9)),
        tuple(ties("F", 60)),
        observations(observe(cameras, xyz, rng, sigma), sigma),
        datum=Datum(DatumType.INNER),
    )
    return Case(network, cameras, xyz)


def hill(rng: np.random.Generator, sigma: float = 0.33, sigma_xyz: float = 0.012) -> Case:
    """Step 2, Fig. 7: three images, 15 surveyed balls and 6 others, 17 positions of the helmet; c known."""
    cameras = hill_cameras(rng)
    balls = rng.uniform((-1.0, -3.0, -8.0), (21.0, 3.0, 0.0), (21, 3))
    xyz = np.vstack((balls, flight_points(rng, 17)))
    surveyed = balls[:15] + rng.normal(0, sigma_xyz, (15, 3))
    control = [Point(f"B{i + 1}", Role.CONTROL, at, np.full(3, sigma_xyz)) for i, at in enumerate(surveyed)]
    network = Network(
        tuple(camera(f"K{i + 1}", cameras[i].c, ()) for i in range(3)),
        tuple(Image(f"hill-{i + 1}", i) for i in range(3)),
        (*control, *ties("T", 6), *ties("H", 17)),
        observations(observe(cameras, xyz, rng, sigma), sigma),
    )
    return Case(network, cameras, xyz)


def rods(rng: np.random.Generator, sigma: float = 0.33) -> Case:
    """Situation B, Fig. 9: a fixed origin, a vertical rod in six places of two lines parallel to XZ, the helmet."""
    cameras = hill_cameras(rng)
    places = [(x, y) for x in (1.0, 10.0, 19.0) for y in (-1.5, 1.5)]
    feet = [np.array([x, y, -0.2 * x - 2.0]) for x, y in places]
    ends = np.array([point for foot in feet for point in (foot, foot + np.array([0.0, 0.0, 2.0]))])
    xyz = np.vstack((np.zeros((1, 3)), ends, flight_points(rng, 17)))
    distances, differences = [], []
    for i in range(len(places)):
        low, high = 1 + 2 * i, 2 + 2 * i
        distances.append(Distance(low, high, 2.0, 0.001))
        differences += [Difference(low, high, axis, 0.0, 0.02) for axis in (0, 1)]
        differences.append(Difference(low, high, 2, 2.0, 0.001))
    differences += [Difference(1 + 2 * i, 5 + 2 * i, 1, 0.0, 0.02) for i in range(len(places) - 2)]
    network = Network(
        tuple(camera(f"K{i + 1}", cameras[i].c, ("c",)) for i in range(3)),
        tuple(Image(f"hill-{i + 1}", i) for i in range(3)),
        (Point("P0", Role.FIXED, np.zeros(3)), *ties("R", len(ends)), *ties("H", 17)),
        observations(observe(cameras, xyz, rng, sigma), sigma),
        tuple(distances),
        tuple(differences),
    )
    return Case(network, cameras, xyz)


def sheet(rng: np.random.Generator, images: int = 12, sigma: float = 0.1) -> Case:
    """A flat calibration sheet with four error-free corners, convergent and rolled images, radial distortion."""
    grid = np.stack(np.meshgrid(np.linspace(0, 1, 8), np.linspace(0, 1, 8)), axis=-1).reshape(-1, 2)
    xyz = np.column_stack((grid, np.zeros(len(grid))))
    c = 2340.0
    cameras = []
    for i in range(images):
        angle = 2 * np.pi * i / images
        centre = np.array([0.5 + 1.2 * np.cos(angle), 0.5 + 1.2 * np.sin(angle), 1.5])
        cameras.append(IdealCamera(c, centre, look_at(centre, np.array([0.5, 0.5, 0.0]), -90.0 * (i % 4))))
    ideal = observe(cameras, xyz, rng, 0.0)
    a1 = -1e-8  # 20 px at the corners of the sheet
    xy = ideal * (1 + a1 * (ideal**2).sum(axis=-1, keepdims=True)) + rng.normal(0, sigma, ideal.shape)
    corners = {0, 7, 56, 63}
    points = [Point(str(i), Role.FIXED, at) if i in corners else Point(str(i), Role.TIE) for i, at in enumerate(xyz)]
    network = Network(
        (camera("C", c, ("c", "x0", "y0", "a1")),),
        tuple(Image(str(i), 0) for i in range(images)),
        tuple(points),
        observations(xy, sigma),
    )
    return Case(network, cameras, xyz)
