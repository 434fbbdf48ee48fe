"""Small planar fields of surveyed balls, seen from afar: networks with two poses for each image, and the truth."""

from dataclasses import dataclass
from itertools import product

import numpy as np

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.network.model import Camera, Image, ImageObservations, Network, Point, Role
from rig.arrays import Floats
from rig.images.viewing import look_at

C, SIGMA, SIGMA_SURVEY = 1000.0, 0.3, 0.002
#: Nine balls, 2 m by 2 m.
GRID = np.array([[x, y, 0.0] for x, y in product((0.0, 1.0, 2.0), repeat=2)])
_STEEPEST = 0.3  # least cosine of the angle between a camera's direction and the normal of the field


@dataclass(frozen=True, slots=True, eq=False)
class Planar:
    """A network without start values, and the truth.

    Attributes:
        network: images of one camera, surveyed balls, perhaps tie points.
        cameras: true, one per image.
        xyz: (points, 3) true.
    """

    network: Network
    cameras: tuple[IdealCamera, ...]
    xyz: Floats


def planar(rng: np.random.Generator, images: int, distance: float, field: Floats = GRID, ties: int = 0) -> Planar:
    """A field in a plane that is turned anyhow, from cameras at about one distance and within about a radian."""
    centre = field.mean(axis=0)
    off = rng.uniform(-1.5, 1.5, (ties, 3)) * (1.0, 1.0, 0.0) + (0.0, 0.0, 1.0) * rng.uniform(0.2, 1.5, (ties, 1))
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    first = _direction(rng, np.zeros(3), 1.0)
    cameras = []
    for k in range(images):
        direction = _direction(rng, first, 0.5) if k else first
        place = centre + distance * rng.uniform(0.9, 1.1) * direction
        rotation = look_at(place, centre + rng.normal(0.0, 0.3, 3), float(rng.uniform(-30.0, 30.0)))
        cameras.append(IdealCamera(C, turn @ place, turn @ rotation))
    return observed(tuple(cameras), np.vstack((field, centre + off)) @ turn.T, len(field), rng)


def _direction(rng: np.random.Generator, near: Floats, spread: float) -> Floats:
    while True:
        direction = near + spread * rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        if abs(direction[2]) > _STEEPEST:
            return np.asarray(direction * np.sign(direction[2]))


def observed(cameras: tuple[IdealCamera, ...], xyz: Floats, surveyed: int, rng: np.random.Generator) -> Planar:
    """The network of all points in all images, with errors; the first points are surveyed, the others ties."""
    n, m = len(xyz), len(cameras)
    survey = xyz + rng.normal(0.0, SIGMA_SURVEY, xyz.shape)
    points = [
        Point(f"G{i}", Role.CONTROL, survey[i], np.full(3, SIGMA_SURVEY)) if i < surveyed else Point(f"T{i}", Role.TIE)
        for i in range(n)
    ]
    xy = np.concatenate([camera.project(xyz) for camera in cameras]) + rng.normal(0.0, SIGMA, (n * m, 2))
    network = Network(
        (Camera("K", np.array([C, *[0.0] * 9])),),
        tuple(Image(f"C{k}", 0) for k in range(m)),
        tuple(points),
        ImageObservations(
            np.repeat(np.arange(m), n),
            np.tile(np.arange(n), m),
            xy,
            np.full((n * m, 2), SIGMA),
            np.zeros(n * m, np.intp),
        ),
        length_unit="m",
    )
    return Planar(network, cameras, xyz)
