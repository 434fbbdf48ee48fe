"""What one image point means for the other images: its epipolar curve with a band of two sigmas.

The ray of the point is sampled over all distances and projected with the lens of the other camera, so that the curve
bends where that lens distorts. The band holds the error of the click and those of both orientations, with their
correlation: to first order a change d(xy) and a change of the cameras' parameters dp move the object point across its
ray by A+ (d(xy) - B dp), with A and B the derivatives of the collinearity equations (A1) of the first camera and A+ the
pseudo-inverse. Moves along the ray stay on the curve.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.pulses.points import rays
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from rig.arrays import Floats

#: Distances from the camera between which an object can be, m.
_NEAREST_M: Final = 0.3
_FARTHEST_M: Final = 3000.0
_SEARCH: Final = 400  # samples that find the part in sight
_SAMPLES: Final = 49  # of this part
_MARGIN: Final = 0.1  # of the image's size, by which the curve goes on outside
_BAND: Final = 2.0  # sigmas


@dataclass(frozen=True, slots=True, eq=False)
class EpipolarCurve:
    """The curve in one image on which the point must be.

    Attributes:
        line: (k, 2) px; empty where the ray is not in sight of this camera.
        low: (k, 2) px, one edge of the band.
        high: (k, 2) px, the other edge.
    """

    line: Floats
    low: Floats
    high: Floats


def epipolar_curves(system: CameraSystem, camera: str, xy: Floats, covariance: Floats) -> dict[str, EpipolarCurve]:
    """Curves in all other images.

    Args:
        system: the oriented cameras.
        camera: in whose image the point is.
        xy: (2,) px.
        covariance: (2, 2) of the point, px^2.
    """
    own = system[camera]
    ray = rays(own, xy[None])[0]
    if not np.isfinite(ray).all():
        return {}
    return {
        name: _curve(system, own, ray, xy, covariance, other)
        for name, other in system.cameras.items()
        if name != camera
    }


def _curve(
    system: CameraSystem, own: PlacedCamera, ray: Floats, xy: Floats, covariance: Floats, other: PlacedCamera
) -> EpipolarCurve:
    distance = np.geomspace(_NEAREST_M, _FARTHEST_M, _SEARCH)
    sight = _in_sight(other, other.project(own.position + ray * distance[:, None]))
    if not sight.any():
        return EpipolarCurve(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2)))
    first, last = np.flatnonzero(sight)[[0, -1]]
    # Once more between the last samples out of sight: one step of the search may be much of the image.
    fine = np.geomspace(distance[max(first - 1, 0)], distance[min(last + 1, _SEARCH - 1)], _SEARCH)
    line = other.project(own.position + ray * fine[:, None])
    inside = np.flatnonzero(_in_sight(other, line))
    fine, line = fine[inside[0] : inside[-1] + 1], line[inside[0] : inside[-1] + 1]
    way = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))))
    fine = np.interp(np.linspace(0.0, way[-1], _SAMPLES), way, fine)
    xyz = own.position + ray * fine[:, None]
    line = other.project(xyz)
    across = _across(line)
    sigma = np.sqrt(np.einsum("ni,nij,nj->n", across, _scatter(system, own, xy, covariance, other, xyz), across))
    return EpipolarCurve(line, line - _BAND * sigma[:, None] * across, line + _BAND * sigma[:, None] * across)


def _scatter(
    system: CameraSystem, own: PlacedCamera, xy: Floats, covariance: Floats, other: PlacedCamera, xyz: Floats
) -> Floats:
    """Covariance (n, 2, 2) of the projections of points of the ray, without what moves along it, px^2."""
    n, p = len(xyz), len(system.covariance)
    _, a, b = own.linearised(xyz, np.broadcast_to(xy, (n, 2)))
    _, there, by_other = other.linearised(xyz, other.project(xyz))
    by_click = there @ np.linalg.pinv(a)
    by_parameters = np.zeros((n, 2, p))
    by_parameters[:, :, own.columns] -= by_click @ b
    by_parameters[:, :, other.columns] += by_other
    return np.asarray(
        by_click @ covariance @ np.swapaxes(by_click, 1, 2)
        + by_parameters @ system.covariance @ np.swapaxes(by_parameters, 1, 2)
    )


def _in_sight(camera: PlacedCamera, px: Floats) -> Floats:
    margin = _MARGIN * camera.size
    with np.errstate(invalid="ignore"):
        return np.asarray(((px > -margin) & (px < camera.size - 1 + margin)).all(axis=1))


def _across(line: Floats) -> Floats:
    """Unit normals (n, 2) of a curve."""
    along = np.gradient(line, axis=0)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.where(length > 0, along / np.where(length > 0, length, 1.0), [1.0, 0.0])
    return np.stack((-along[:, 1], along[:, 0]), axis=1)
