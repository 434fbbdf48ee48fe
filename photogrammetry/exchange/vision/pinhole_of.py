"""A camera of the network as a camera of computer vision, and its pose: the inverse of `pinhole`.

With xs' = s xs, s = 1 - a1 r0^2 - a2 r0^4 - a3 r0^6, a balanced radial distortion is an unbalanced one of the principal
distance s c: ai' = ai / s^(2i+1), bi' = bi / s^2, c1' = c1 / s.
"""

from typing import Final

import numpy as np
from scipy.optimize import least_squares

from photogrammetry.exchange.vision.pinhole import Pinhole
from photogrammetry.geometry.camera_model import distort, undistort
from photogrammetry.geometry.rotation import vector_from_rotation
from photogrammetry.network.model import Camera, Image
from rig.arrays import Floats
from rig.errors import BadInputError

_GRID: Final = 25  # places along each side of the picture at which models are compared
_EXACT_PX: Final = 1e-9
_MOST_PX: Final = 1.0  # a lens that differs by more is another one


def pinhole_of(camera: Camera) -> tuple[Pinhole, float]:
    """The camera, and by how much its image points differ from those of the network over the picture (px).

    Exact for a distortion of the ideal points (`projected`) without shear, and without affinity beside distortion; else
    the nearest parameters over the picture.

    Raises:
        BadInputError: the image size is not known, or no parameters come within a pixel.
    """
    if camera.size is None:
        raise BadInputError(f"camera {camera.name}: its image size is not known; give its size in the network file")
    xy = _directions(camera, camera.size)
    direct = _direct(camera, camera.size)
    rest = _apart(direct, camera, xy)
    if rest <= _EXACT_PX:
        return direct, rest
    scale = np.abs(_vector(direct)).clip(min=1e-3)
    wanted = _seen(camera, xy)
    best = least_squares(
        lambda values: (_with(direct, values * scale).project(xy) - wanted).ravel(),
        _vector(direct) / scale,
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    fitted = _with(direct, best.x * scale)
    rest = _apart(fitted, camera, xy)
    if not rest <= _MOST_PX:
        raise BadInputError(
            f"camera {camera.name}: OpenCV's distortion does not come near it: image points would differ by up to "
            f"{rest:.2g} px; calibrate it without affinity and shear"
        )
    return fitted, rest


def pose_of(image: Image) -> tuple[Floats, Floats]:
    """Rotation vector (3,) and translation (3,) from the object to the camera system with y down and z forward.

    Raises:
        BadInputError: the image has no pose.
    """
    if image.position is None or image.rotation is None:
        raise BadInputError(f"image {image.name}: has no pose; orient the network first")
    turn = (image.rotation * (1.0, -1.0, -1.0)).T
    return vector_from_rotation(turn), -turn @ image.position


def _direct(camera: Camera, size: tuple[int, int]) -> Pinhole:
    """The camera where it can be written down, without shear."""
    c, x0, y0, a1, a2, a3, b1, b2, c1, _ = camera.interior.tolist()
    r2 = camera.balance**2
    s = 1.0 - r2 * (a1 + r2 * (a2 + r2 * a3))
    f = c * s
    radial = tuple(a / s ** (2 * i + 1) * f ** (2 * i) for i, a in enumerate((a1, a2, a3), start=1))
    width, height = size
    return Pinhole(
        size,
        (f * (1.0 + c1 / s), f),
        ((width - 1) / 2.0 + x0, (height - 1) / 2.0 - y0),
        (*radial, 0.0, 0.0, 0.0),
        (-b2 / s**2 * f, b1 / s**2 * f),
    )


def _directions(camera: Camera, size: tuple[int, int]) -> Floats:
    """Directions x = X/Z, y = Y/Z (n, 2) that places all over the picture show."""
    half = (np.array(size) - 1.0) / 2.0
    x, y = np.meshgrid(np.linspace(-half[0], half[0], _GRID), np.linspace(-half[1], half[1], _GRID))
    ideal = undistort(camera.lens(), np.column_stack((x.ravel(), y.ravel())))
    return np.asarray(ideal[np.isfinite(ideal).all(axis=1)] / camera.interior[0] * (1.0, -1.0))


def _seen(camera: Camera, xy: Floats) -> Floats:
    return np.asarray(distort(camera.lens(), camera.interior[0] * xy * (1.0, -1.0)))


def _apart(pinhole: Pinhole, camera: Camera, xy: Floats) -> float:
    return float(np.abs(pinhole.project(xy) - _seen(camera, xy)).max(initial=0.0))


def _vector(pinhole: Pinhole) -> Floats:
    return np.array([*pinhole.focal, *pinhole.principal, *pinhole.radial[:3], *pinhole.tangential])


def _with(pinhole: Pinhole, values: Floats) -> Pinhole:
    fx, fy, cx, cy, k1, k2, k3, p1, p2 = values.tolist()
    return Pinhole(pinhole.size, (fx, fy), (cx, cy), (k1, k2, k3, 0.0, 0.0, 0.0), (p1, p2))
