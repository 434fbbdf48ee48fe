"""Projects balls into the picture of a camera: places, standard deviations, and what lies beyond the picture."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.scene.camera_system import CameraSystem, PlacedCamera
from photogrammetry.geometry.camera_model import camera_coordinates, distort, ideal_point
from photogrammetry.network.model import Camera
from rig.api.cameras.balls import BallPlace
from rig.arrays import Floats

#: Part of half the picture's diagonal up to which the distortion of a lens is believed. It is known in the picture
#: only; far outside its polynomial would fold the world back into the picture.
_REACH: Final = 1.25
_MIRROR: Final = np.array([1.0, -1.0])  # pixel frame to metric frame
_DIGITS: Final = 2  # of a place, px
_NO_PARAMETERS: Final = np.zeros(0, np.intp)


@dataclass(frozen=True, slots=True, eq=False)
class Balls:
    """Balls with coordinates.

    Attributes:
        names: n names.
        xyz: (n, 3).
        covariance: (n, 3, 3).
        seen: whether each was found in the camera's pictures when it was oriented; None: the camera was not.
    """

    names: Sequence[str]
    xyz: Floats
    covariance: Floats
    seen: Sequence[bool] | None = None


def standing(camera: Camera, position: Floats, rotation: Floats) -> PlacedCamera:
    """A camera at a pose about whose errors nothing joint is known; see `PlacedCamera`."""
    return PlacedCamera(camera, position, rotation, _NO_PARAMETERS, np.arange(6))


def of_system(system: CameraSystem, name: str, balls: Balls) -> tuple[BallPlace, ...]:
    """Where an oriented camera shows balls. How pose and balls are correlated is left out of the sigmas."""
    placed = system[name]
    return places(placed, system.covariance[np.ix_(placed.columns, placed.columns)], balls)


def places(placed: PlacedCamera, covariance: Floats | None, balls: Balls) -> tuple[BallPlace, ...]:
    """Where a camera shows balls.

    Args:
        placed: the camera; its image size is known.
        covariance: (6 + k, 6 + k) of X0, the turns about its own axes (rad) and its k uncertain interior parameters;
            None: not known.
        balls: the balls.
    """
    xy = _projected(placed, balls.xyz)
    inside = np.asarray((np.abs(xy - (placed.size - 1) / 2) <= placed.size / 2).all(axis=-1))
    sigmas = np.full_like(xy, np.nan)
    if covariance is not None and inside.any():
        _, by_point, by_camera = placed.linearised(balls.xyz[inside], xy[inside])
        spread = _carried(by_point, balls.covariance[inside]) + _carried(by_camera, covariance)
        sigmas[inside] = np.sqrt(np.diagonal(spread, axis1=1, axis2=2))
    return tuple(
        BallPlace(
            name=name,
            x=_number(xy[i, 0]),
            y=_number(xy[i, 1]),
            sigma=None if np.isnan(sigmas[i, 0]) else (_positive(sigmas[i, 0]), _positive(sigmas[i, 1])),
            inside=bool(inside[i]),
            seen=None if balls.seen is None else balls.seen[i],
        )
        for i, name in enumerate(balls.names)
    )


def _projected(placed: PlacedCamera, xyz: Floats) -> Floats:
    """Places (n, 2), px, of object points (n, 3); NaN behind the camera.

    Beyond `_REACH` the distortion grows no more.
    """
    lens = placed.camera.lens()
    k = camera_coordinates(placed.rotation, placed.position, xyz)
    with np.errstate(all="ignore"):
        ideal = np.asarray(ideal_point(lens.interior[0], k), float)
        away, reach = np.asarray(np.hypot(ideal[:, 0], ideal[:, 1])), _REACH * float(np.hypot(*placed.size)) / 2
        near = ideal * np.asarray(reach / np.maximum(away, reach))[:, None]
        shift = np.asarray(distort(lens, near), float) - near
    # a distortion without an inverse is one of no real lens: better the straight ray than no place
    px = (ideal + np.nan_to_num(shift)) * _MIRROR + (placed.size - 1) / 2
    return np.where(np.asarray(placed.in_front(xyz))[:, None], px, np.nan)


def _carried(derivatives: Floats, covariance: Floats) -> Floats:
    return np.asarray(derivatives @ covariance @ derivatives.transpose(0, 2, 1))


def _number(value: float) -> float | None:
    return round(float(value), _DIGITS) if np.isfinite(value) else None


def _positive(value: float) -> float:
    return round(float(value), _DIGITS)
