"""The paper's geometries, and random ones like them, with known truth."""

from dataclasses import dataclass

import numpy as np

from photogrammetry.geometry.ideal_camera import IdealCamera
from rig.arrays import Floats
from rig.images.viewing import look_at

SIGMA_PX = 0.33
HALF_SKI_M = 2.63 / 2


def hill_cameras(rng: np.random.Generator) -> list[IdealCamera]:
    """Three cameras on one side (Fig. 7): c = 1420, 1420, 2493 px at 44, 44, 78 m, each sees the first 20 m."""
    target = np.array([10.0, 0.0, -1.0])
    cameras = []
    for c, distance, azimuth in ((1420.0, 44.0, -0.35), (1420.0, 44.0, 0.35), (2493.0, 78.0, -0.15)):
        angle = azimuth + rng.uniform(-0.05, 0.05)
        height = rng.uniform(-0.05, 0.15)
        direction = np.array([np.sin(angle), -np.cos(angle), height])
        centre = target + distance * direction / np.linalg.norm(direction)
        aim = target + rng.uniform(-0.5, 0.5, 3)
        cameras.append(IdealCamera(c, centre, look_at(centre, aim, -np.degrees(rng.uniform(-0.05, 0.05)))))
    return cameras


def flight_points(rng: np.random.Generator, n: int) -> Floats:
    """Points on a jumper in the first 20 m of flight."""
    return rng.uniform((0.0, -1.5, -5.0), (20.0, 1.5, 2.0), (n, 3))


@dataclass(frozen=True, slots=True)
class Ski:
    """A ski as a line C8 and the stretch of X that it covers."""

    parameters: Floats  # alpha, beta, gamma, delta
    x: float

    def points(self, n: int) -> Floats:
        alpha, beta, gamma, delta = self.parameters
        half = HALF_SKI_M / np.sqrt(1 + alpha**2 + beta**2)
        x = np.linspace(self.x - half, self.x + half, n)
        return np.column_stack((x, beta * x + delta, alpha * x + gamma))


def ski(rng: np.random.Generator, side: float = 0.0) -> Ski:
    """A ski in flight; `side` (-1 or 1) opens the V and shifts it to its own side."""
    x, z = rng.uniform(1.0, 19.0), rng.uniform(-4.0, 1.0)
    alpha = rng.uniform(-0.3, 0.3)
    beta = rng.uniform(-0.1, 0.1) + 0.2 * side
    y = 0.25 * side + rng.uniform(-0.1, 0.1)
    return Ski(np.array([alpha, beta, z - alpha * x, y - beta * x]), x)


def lab_cameras(rng: np.random.Generator) -> list[IdealCamera]:
    """Nine convergent, rolled images of a frame at the origin (Fig. 5): two cameras at 2 m, one at 4 m."""
    cameras = []
    for c, distance in ((1420.0, 2.0), (1420.0, 2.0), (2493.0, 4.0)):
        for azimuth, roll in ((-0.6, 0.0), (0.0, np.pi / 2), (0.6, -np.pi / 2)):
            angle = azimuth + rng.uniform(-0.15, 0.15)
            direction = np.array([np.sin(angle), -np.cos(angle), rng.uniform(-0.1, 0.6)])
            centre = distance * direction / np.linalg.norm(direction)
            aim = rng.uniform(-0.03, 0.03, 3)
            cameras.append(IdealCamera(c, centre, look_at(centre, aim, -np.degrees(roll + rng.uniform(-0.1, 0.1)))))
    return cameras


def frame_points(rng: np.random.Generator, n: int = 60) -> Floats:
    """Targets in the laboratory frame, 0.5 m x 0.5 m x 0.3 m."""
    return rng.uniform((-0.25, -0.15, -0.25), (0.25, 0.15, 0.25), (n, 3))


def observe(cameras: list[IdealCamera], points: Floats, rng: np.random.Generator, sigma: float = SIGMA_PX) -> Floats:
    """(n, m, 2) image coordinates with noise."""
    xy = np.stack([camera.project(points) for camera in cameras], axis=1)
    return np.asarray(xy + rng.normal(0.0, sigma, xy.shape) if sigma else xy)
