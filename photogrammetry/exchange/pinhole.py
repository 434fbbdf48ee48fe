"""Cameras and poses as computer vision writes them (OpenCV, COLMAP), carried over into the conventions of the network.

OpenCV: x = X/Z, y = Y/Z in a camera system with y down and z forward, r^2 = x^2 + y^2, and
u = fx x'' + skew y'' + cx, v = fy y'' + cy with

    x'' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2),
    y'' = y (...) / (...) + p1 (r^2 + 2 y^2) + 2 p2 x y.

With one focal length f and k4 = k5 = k6 = 0 that is exactly the "projected" distortion of the network:
a1 = k1/f^2, a2 = k2/f^4, a3 = k3/f^6, b1 = p2/f, b2 = -p1/f. Else the nearest parameters are fitted over the picture.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from photogrammetry.geometry.camera_model import INTERIOR, Lens, distort, linearise
from photogrammetry.geometry.rotation import nearest_rotation
from rig.arrays import Floats
from rig.errors import BadInputError

_GRID: Final = 25  # places along each side of the picture at which models are compared
_STEPS: Final = 10  # Gauss-Newton; the model is nearly linear
_EXACT_PX: Final = 1e-6


@dataclass(frozen=True, slots=True)
class Pinhole:
    """A camera of computer vision; cx, cy count from the centre of the top left pixel.

    Attributes:
        size: width, height (px).
        focal: fx, fy (px).
        principal: cx, cy (px).
        radial: k1 to k6, OpenCV's order of meaning.
        tangential: p1, p2.
        skew: of the camera matrix (px).
    """

    size: tuple[int, int]
    focal: tuple[float, float]
    principal: tuple[float, float]
    radial: tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    tangential: tuple[float, float] = (0.0, 0.0)
    skew: float = 0.0

    def project(self, xy: Floats) -> Floats:
        """Metric image coordinates (n, 2) of x = X/Z, y = Y/Z (n, 2)."""
        x, y = xy[:, 0], xy[:, 1]
        r2 = x * x + y * y
        k1, k2, k3, k4, k5, k6 = self.radial
        p1, p2 = self.tangential
        factor = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        across = x * factor + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
        down = y * factor + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        u = self.focal[0] * across + self.skew * down + self.principal[0]
        v = self.focal[1] * down + self.principal[1]
        return np.column_stack((u - (self.size[0] - 1) / 2.0, (self.size[1] - 1) / 2.0 - v))


def camera_entry(pinhole: Pinhole, place: str) -> tuple[dict[str, Any], float]:
    """The camera as an entry of the network file.

    Args:
        pinhole: the camera.
        place: where it stands, for messages.

    Returns:
        The entry, and by how much its image points differ from those of the other program, at most (px); 0: not at all.

    Raises:
        BadInputError: the numbers are those of no camera.
    """
    if min(*pinhole.size, *pinhole.focal) <= 0.0:
        raise BadInputError(f"{place}: image size and focal lengths must be positive; correct them there")
    with np.errstate(all="ignore"):
        interior, rest = _nearest(pinhole)
    if not rest < max(pinhole.size):  # also where it is no number
        raise BadInputError(f"{place}: the distortion cannot be carried over; calibrate again (svev calibrate)")
    entry: dict[str, Any] = {"size": list(pinhole.size)}
    entry |= {name: float(value) for name, value in zip(INTERIOR, interior, strict=True)}
    return entry | {"distortion": "projected"}, rest if rest > _EXACT_PX else 0.0


def pose_entry(rotation: Floats, translation: Floats) -> dict[str, Any]:
    """X0 and R of an image from a pose x = R X + t of computer vision (y down, z forward).

    Args:
        rotation: (3, 3).
        translation: (3,), object unit.
    """
    turned = nearest_rotation(np.asarray(rotation, dtype=float))
    axes = turned.T * (1.0, -1.0, -1.0)
    return {"X0": (-turned.T @ np.asarray(translation, dtype=float)).tolist(), "R": axes.tolist()}


def _nearest(pinhole: Pinhole) -> tuple[Floats, float]:
    """The interior orientation (10,), and the largest difference of image points (px), infinite without a solution."""
    interior, xy = _direct(pinhole), _over_the_picture(pinhole)
    target = pinhole.project(xy)
    if np.abs(_ours(interior, xy) - target).max() > _EXACT_PX:
        try:
            interior = _fitted(interior, xy, target)
        except np.linalg.LinAlgError:
            return interior, np.inf
    return interior, float(np.abs(_ours(interior, xy) - target).max())


def _direct(pinhole: Pinhole) -> Floats:
    """The interior orientation where it can be written down: (10,) in the order of `INTERIOR`."""
    (fx, fy), (cx, cy), (width, height) = pinhole.focal, pinhole.principal, pinhole.size
    k1, k2, k3 = pinhole.radial[:3]
    p1, p2 = pinhole.tangential
    principal = (cx - (width - 1) / 2.0, (height - 1) / 2.0 - cy)
    radial = (k1 / fy**2, k2 / fy**4, k3 / fy**6)
    return np.array([fy, *principal, *radial, p2 / fy, -p1 / fy, fx / fy - 1.0, -pinhole.skew / fy])


def _over_the_picture(pinhole: Pinhole) -> Floats:
    """Directions x = X/Z, y = Y/Z, (n, 2), that an undistorted camera would see in the picture."""
    (fx, fy), (cx, cy), (width, height) = pinhole.focal, pinhole.principal, pinhole.size
    u, v = np.meshgrid(np.linspace(0.0, width - 1.0, _GRID), np.linspace(0.0, height - 1.0, _GRID))
    return np.column_stack(((u.ravel() - cx) / fx, (v.ravel() - cy) / fy))


def _ours(interior: Floats, xy: Floats) -> Floats:
    """Metric image coordinates (n, 2) of the same directions by the network's model."""
    return distort(_lens(interior), interior[0] * xy * (1.0, -1.0))


def _fitted(start: Floats, xy: Floats, target: Floats) -> Floats:
    """The interior orientation that is nearest to the target (n, 2) over the picture, by Gauss-Newton."""
    interior = start.copy()
    points = np.column_stack((xy * (1.0, -1.0), np.full(len(xy), -1.0)))
    for _ in range(_STEPS):
        lines = linearise(_lens(interior[None]), np.eye(3)[None], np.zeros((1, 3)), points, target)
        slopes = np.asarray(lines.by_interior, dtype=float).reshape(-1, len(INTERIOR))
        size = np.linalg.norm(slopes, axis=0)
        step = np.linalg.lstsq(slopes / size, -np.asarray(lines.v, dtype=float).ravel(), rcond=None)[0]
        interior = interior + step / size
    return interior


def _lens(interior: Floats) -> Lens:
    return Lens(interior, np.zeros(interior.shape[:-1]), np.zeros(interior.shape[:-1], dtype=bool))
