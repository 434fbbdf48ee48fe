"""Cameras and poses as computer vision writes them (OpenCV, COLMAP), carried over into the conventions of the network.

OpenCV: x = X/Z, y = Y/Z in a camera system with y down and z forward, r^2 = x^2 + y^2, and
u = fx x'' + skew y'' + cx, v = fy y'' + cy with

    x'' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2),
    y'' = y (...) / (...) + p1 (r^2 + 2 y^2) + 2 p2 x y.

With one focal length f and k4 = k5 = k6 = 0 that is exactly the "projected" distortion of the network:
a1 = k1/f^2, a2 = k2/f^4, a3 = k3/f^6, b1 = p2/f, b2 = -p1/f. Else the nearest parameters are fitted over the pixels of
the picture; a lens that they do not meet within a pixel is refused.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from photogrammetry.geometry.camera_model import INTERIOR, Lens, distort, linearise
from photogrammetry.geometry.rotation import nearest_rotation
from photogrammetry.network.entries import LARGEST
from rig.arrays import Floats
from rig.errors import BadInputError

_GRID: Final = 25  # places along each side of the picture at which models are compared
_DISTORTION_STEPS: Final = 10  # Gauss-Newton; the model is nearly linear
_EXACT_PX: Final = 1e-6
_MOST_PX: Final = 1.0  # a lens that differs by more is another one
_ANGLES: Final = np.radians(np.linspace(0.0, 89.5, 4000))  # off the axis, at which a lens is sampled
_SLOPE: Final = 1e-6  # step of a numerical derivative, relative
_NEWTON: Final = 8  # steps from a sampled lens, which is right to a thousandth, to the last digit
_SAME_DIRECTION: Final = 1e-9  # of a direction, relative to 1: much less than a pixel
_FAR_OFF: Final = 0.25  # of the picture's width or height: no camera's principal point is so far from the middle
_NOT_MIDDLE: Final = 0.05  # of the diagonal: what tells a turned picture from a principal point that is a little off
_OBLONG: Final = 1.25  # fx / fy of pixels that are no square


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

    def distorted(self, xy: Floats) -> Floats:
        """x'', y'' (n, 2) of x = X/Z, y = Y/Z (n, 2)."""
        x, y = xy[:, 0], xy[:, 1]
        r2 = x * x + y * y
        p1, p2 = self.tangential
        factor = self.factor(r2)
        across = x * factor + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
        down = y * factor + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        return np.column_stack((across, down))

    def factor(self, r2: Floats) -> Floats:
        """By how much radial distortion stretches directions at squared distances r2 from the axis."""
        k1, k2, k3, k4, k5, k6 = self.radial
        return (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))

    def project(self, xy: Floats) -> Floats:
        """Metric image coordinates (n, 2) of x = X/Z, y = Y/Z (n, 2)."""
        across, down = self.distorted(xy).T
        u = self.focal[0] * across + self.skew * down + self.principal[0]
        v = self.focal[1] * down + self.principal[1]
        return np.column_stack((u - (self.size[0] - 1) / 2.0, (self.size[1] - 1) / 2.0 - v))


def doubts(size: tuple[float, float], principal: tuple[float, float], unit: str) -> list[str]:
    """What speaks against a camera: a picture that is turned, or of another size.

    Args:
        size: width and height of the picture.
        principal: point, from the middle of the picture; all in the same unit.
        unit: its name.
    """
    (width, height), (x, y) = size, principal
    turned = np.hypot(x + (width - height) / 2.0, y + (width - height) / 2.0)  # from the middle of height x width
    where = f"the principal point is {x:.4g}, {y:.4g} {unit} from the middle of the picture"
    if 2.0 * turned < np.hypot(x, y) > _NOT_MIDDLE * np.hypot(width, height):
        return [f"{where}: look whether its width and height are exchanged"]
    if abs(x) > _FAR_OFF * width or abs(y) > _FAR_OFF * height:
        return [f"{where}: look whether image size and calibration belong to the same pictures"]
    return []


def camera_entry(pinhole: Pinhole, place: str, program: str) -> tuple[dict[str, Any], list[str]]:
    """The camera as an entry of the network file.

    Args:
        pinhole: the camera.
        place: where it stands, for messages.
        program: that wrote it.

    Returns:
        The entry, and what to know about it: by how much its image points differ from those of the other program, where
        the lens folds, and what speaks against the camera.

    Raises:
        BadInputError: the numbers are those of no camera, or the network's distortion does not come near it.
    """
    lengths = (*pinhole.size, *pinhole.focal)
    if min(lengths) <= 0.0 or max(*lengths, *map(abs, pinhole.principal)) > LARGEST:
        raise BadInputError(
            f"{place}: image size and focal lengths must be positive, and no larger than a picture is; "
            "correct them there"
        )
    with np.errstate(all="ignore"):
        xy, reached = _over_the_picture(pinhole)
        interior, rest = _nearest(pinhole, xy)
    if not rest <= _MOST_PX or np.abs(interior).max() > LARGEST:  # also where it is no number
        by = f": image points would differ by up to {rest:.2g} px" if _MOST_PX < rest < np.inf else ""
        raise BadInputError(f"{place}: the distortion cannot be carried over{by}; calibrate again (svev calibrate)")
    notes = [f"image points differ from {program}'s by up to {rest:.2g} px"] if rest > _EXACT_PX else []
    if reached < 1.0:
        notes.append(
            f"the distortion folds inside the picture: {1.0 - reached:.0%} of it shows no direction, and points near "
            "there are wrong; calibrate with points up to the corners"
        )
    (width, height), (cx, cy) = pinhole.size, pinhole.principal
    notes += doubts(pinhole.size, (cx - (width - 1) / 2.0, (height - 1) / 2.0 - cy), "px")
    if not 1.0 / _OBLONG < pinhole.focal[0] / pinhole.focal[1] < _OBLONG:
        notes.append("fx and fy differ as those of no usual camera; look whether they are right")
    entry: dict[str, Any] = {"size": list(pinhole.size)}
    entry |= {name: float(value) for name, value in zip(INTERIOR, interior, strict=True)}
    return entry | {"distortion": "projected"}, notes


def pose_entry(rotation: Floats, translation: Floats) -> dict[str, Any]:
    """X0 and R of an image from a pose x = R X + t of computer vision (y down, z forward).

    Args:
        rotation: (3, 3).
        translation: (3,), object unit.
    """
    turned = nearest_rotation(np.asarray(rotation, dtype=float))
    axes = turned.T * (1.0, -1.0, -1.0)
    return {"X0": (-turned.T @ np.asarray(translation, dtype=float)).tolist(), "R": axes.tolist()}


def _nearest(pinhole: Pinhole, xy: Floats) -> tuple[Floats, float]:
    """The interior orientation (10,), and the largest difference of image points (px), infinite without a solution.

    Args:
        pinhole: the camera.
        xy: (n, 2) directions at which models are compared.
    """
    interior = _direct(pinhole)
    if not len(xy):
        return interior, np.inf
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


def _over_the_picture(pinhole: Pinhole) -> tuple[Floats, float]:
    """Directions x = X/Z, y = Y/Z, (n, 2), that places all over the picture show, and the share of places that do.

    A lens folds where points farther from the axis come nearer to it in the picture again; beyond, no place shows any.
    """
    (fx, fy), (cx, cy), (width, height) = pinhole.focal, pinhole.principal, pinhole.size
    u, v = np.meshgrid(np.linspace(0.0, width - 1.0, _GRID), np.linspace(0.0, height - 1.0, _GRID))
    down = (v.ravel() - cy) / fy
    wanted = np.column_stack(((u.ravel() - cx - pinhole.skew * down) / fx, down))
    r = np.tan(_ANGLES)
    seen = r * pinhole.factor(r * r)
    falls = ~(np.diff(seen) > 0.0)
    count = int(falls.argmax()) + 1 if falls.any() else len(r)
    far = np.linalg.norm(wanted, axis=1)
    start = np.interp(far, seen[:count], r[:count])
    xy = wanted * np.where(far > 0.0, start / np.where(far > 0.0, far, 1.0), 1.0)[:, None]
    for _ in range(_NEWTON):
        xy = xy - _newton_step(pinhole, xy, wanted)
    off = np.linalg.norm(pinhole.distorted(xy) - wanted, axis=1)
    shows = (off < _SAME_DIRECTION * (1.0 + far)) & (np.linalg.norm(xy, axis=1) <= r[count - 1])
    return xy[shows], float(shows.mean())


def _newton_step(pinhole: Pinhole, xy: Floats, wanted: Floats) -> Floats:
    """(n, 2) the step of Newton's method towards the directions that the lens shows at `wanted` (n, 2)."""
    h = _SLOPE * (1.0 + np.linalg.norm(xy, axis=1, keepdims=True))
    by = [(pinhole.distorted(xy + h * axis) - pinhole.distorted(xy - h * axis)) / (2.0 * h) for axis in np.eye(2)]
    (a, c), (b, d) = by[0].T, by[1].T
    off = pinhole.distorted(xy) - wanted
    step = np.column_stack((d * off[:, 0] - b * off[:, 1], a * off[:, 1] - c * off[:, 0])) / (a * d - b * c)[:, None]
    return np.asarray(step)


def _ours(interior: Floats, xy: Floats) -> Floats:
    """Metric image coordinates (n, 2) of the same directions by the network's model."""
    return distort(_lens(interior), interior[0] * xy * (1.0, -1.0))


def _fitted(start: Floats, xy: Floats, target: Floats) -> Floats:
    """The interior orientation that is nearest to the target (n, 2) over the picture, by Gauss-Newton."""
    interior = start.copy()
    points = np.column_stack((xy * (1.0, -1.0), np.full(len(xy), -1.0)))
    for _ in range(_DISTORTION_STEPS):
        lines = linearise(_lens(interior[None]), np.eye(3)[None], np.zeros((1, 3)), points, target)
        slopes = np.asarray(lines.by_interior, dtype=float).reshape(-1, len(INTERIOR))
        size = np.linalg.norm(slopes, axis=0)
        step = np.linalg.lstsq(slopes / size, -np.asarray(lines.v, dtype=float).ravel(), rcond=None)[0]
        interior = interior + step / size
    return interior


def _lens(interior: Floats) -> Lens:
    return Lens(interior, np.zeros(interior.shape[:-1]), np.zeros(interior.shape[:-1], dtype=bool))
