"""The cameras as identification needs them: projection with derivatives, and what makes rays of one marker miss.

Rays of one marker miss each other by the errors of its spots, by those of the poses, and because a marker is no point:
cameras from different directions see different parts of it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import chdtri

from analysis.scene.camera_system import CameraSystem, PlacedCamera
from photogrammetry.geometry.camera_model import INTERIOR, Lens, camera_coordinates, image_point, linearise, undistort
from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.network.file import pixel_to_metric
from rig.arrays import Flags, Floats, Integers

#: Standard deviation of the point of a marker that a camera sees as its centre, m: a fraction of a marker's radius.
MARKER_SIGMA_M = 0.01
#: Share of true correspondences that a gate lets pass.
GATE = 0.999
_MIRROR = np.array([1.0, -1.0])  # metric frame to pixel frame
_POSE = 6
_AXES_PULL = 1e-6  #: keeps the scene's centre finite where all cameras look in one direction


@cache
def gate(degrees_of_freedom: int) -> float:
    """Chi-square below which `GATE` of the true correspondences lie."""
    return float(chdtri(degrees_of_freedom, 1 - GATE))


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """How a camera sees n object points.

    Attributes:
        xy: (n, 2) px; NaN behind the camera.
        by_point: (n, 2, 3) derivatives by the object point.
        pose: (n, 2, 2) px^2, covariance by the errors of the camera's pose and interior orientation.
        inside: (n,) whether the point lies in the image.
    """

    xy: Floats
    by_point: Floats
    pose: Floats
    inside: Flags

    @property
    def noise(self) -> Floats:
        """(n, 2, 2) px^2, by the camera and by the size of a marker; without spot and object point."""
        return np.asarray(self.pose + MARKER_SIGMA_M**2 * self.by_point @ self.by_point.transpose(0, 2, 1))

    def only(self, chosen: slice) -> "Sight":
        """Some of the points."""
        return Sight(self.xy[chosen], self.by_point[chosen], self.pose[chosen], self.inside[chosen])


class Views:
    """The cameras of a recording, in their order.

    Attributes:
        names: of the cameras.
        placed: the cameras.
        ideal: the cameras without distortion, for `PlacedCamera.reduced` coordinates.
        position: (m, 3) of the cameras, m.
        exposure_s: (m,) exposure times.
        late_s: (m,) how much later than the mean of all cameras each one shows the scene.
        centre: (3,) the point that all cameras look at.
        noise: (m,) px^2, variance of an image coordinate there, as in `Sight.noise`.
        scale: (m,) px per m there.
    """

    def __init__(self, system: CameraSystem, exposures_s: Mapping[str, float] | None = None) -> None:
        self.system = system
        self.names = system.names
        self.placed: Sequence[PlacedCamera] = [system[name] for name in self.names]
        self.ideal: Sequence[IdealCamera] = [placed.ideal() for placed in self.placed]
        self.exposure_s = np.array([(exposures_s or {}).get(name, 0.0) for name in self.names])
        self.late_s = (self.exposure_s - self.exposure_s.mean()) / 2
        self.position = np.array([placed.position for placed in self.placed])
        self._rotation = np.array([placed.rotation for placed in self.placed])
        self._size = np.array([placed.size for placed in self.placed])
        lenses = [placed.camera.lens() for placed in self.placed]
        interior = np.array([lens.interior for lens in lenses])
        self._lens = Lens(interior, np.array([x.balance for x in lenses]), np.array([x.measured for x in lenses]))
        self._poses = np.array([_of_pose(system, placed) for placed in self.placed])
        self.centre = _looked_at(self.ideal)
        sights = self.see_all(self.centre[None])
        self.noise = np.array([np.trace(sight.noise[0]) / 2 for sight in sights])
        self.scale = np.array([np.linalg.norm(sight.by_point[0], ord=2) for sight in sights])

    def __len__(self) -> int:
        return len(self.names)

    def see(self, k: int, xyz: Floats) -> Sight:
        """Project object points (n, 3) into camera k."""
        return self._seen(np.array([k]), xyz[None])[0]

    def see_all(self, xyz: Floats) -> list[Sight]:
        """Project object points into all cameras: what `see` says, in little more time than for one.

        Args:
            xyz: (n, 3), or (m, n, 3) where they are others for each camera.
        """
        return self._seen(np.arange(len(self.names)), xyz if xyz.ndim == 3 else xyz[None])

    def _seen(self, cameras: Integers, xyz: Floats) -> list[Sight]:
        """Sights of some cameras (c,); the object points are (c, n, 3), or (1, n, 3)."""
        c, n = len(cameras), xyz.shape[1]
        each = np.repeat(cameras, n)
        points = np.broadcast_to(xyz, (c, n, 3)).reshape(-1, 3)
        lens = Lens(self._lens.interior[each], self._lens.balance[each], self._lens.measured[each])
        rotation, position, size = self._rotation[each], self.position[each], self._size[each]
        before = camera_coordinates(rotation, position, points)[:, 2:] < 0
        with np.errstate(all="ignore"):
            metric = np.where(before, image_point(lens, rotation, position, points), np.nan)
            equations = linearise(lens, rotation, position, points, metric)
        by_own = np.concatenate((equations.by_pose, equations.by_interior), axis=2) * _MIRROR[:, None]
        by_own = by_own.reshape(c, n, 2, -1)
        pose = by_own @ self._poses[cameras, None] @ by_own.swapaxes(2, 3)
        by_point = (equations.by_point * _MIRROR[:, None]).reshape(c, n, 2, 3)
        xy = (metric * _MIRROR + (size - 1) / 2).reshape(c, n, 2)
        return [Sight(xy[i], by_point[i], pose[i], _inside(self.placed[k], xy[i])) for i, k in enumerate(cameras)]

    def reduced(self, xy: Sequence[Floats]) -> list[Floats]:
        """`PlacedCamera.reduced` for image points (n, 2) of every camera, in little more time than for one."""
        counts = [len(of_camera) for of_camera in xy]
        each = np.repeat(np.arange(len(xy)), counts)
        lens = Lens(self._lens.interior[each], self._lens.balance[each], self._lens.measured[each])
        ideal = undistort(lens, pixel_to_metric(np.concatenate(xy), self._size[each]))
        return np.split(np.asarray(ideal, float), np.cumsum(counts)[:-1])

    def inside(self, k: int, xyz: Floats) -> Flags:
        """Whether object points (n, 3) lie in the image of camera k: what `see` says, faster."""
        return _inside(self.placed[k], self.placed[k].project(xyz))


def _inside(placed: PlacedCamera, xy: Floats) -> Flags:
    """Whether image points (n, 2), px, lie in the image; NaN does not."""
    with np.errstate(invalid="ignore"):
        return np.asarray(((xy > -0.5) & (xy < placed.size - 0.5)).all(axis=1))


def _of_pose(system: CameraSystem, placed: PlacedCamera) -> Floats:
    """Covariance (16, 16) of pose and interior orientation of a camera; zero where it is certain."""
    uncertain = np.concatenate((np.arange(_POSE), _POSE + placed.interior))
    covariance = np.zeros((_POSE + len(INTERIOR),) * 2)
    covariance[np.ix_(uncertain, uncertain)] = system.covariance[np.ix_(placed.columns, placed.columns)]
    return covariance


def _looked_at(cameras: Sequence[IdealCamera]) -> Floats:
    """The point nearest to the axes of all cameras."""
    normal, right = np.zeros((3, 3)), np.zeros(3)
    apart = max(float(np.linalg.norm(a.X0 - b.X0)) for a in cameras for b in cameras) or 1.0
    for camera in cameras:
        axis = camera.R[:, 2]
        across = np.eye(3) - np.outer(axis, axis)
        pull = _AXES_PULL * np.eye(3)
        normal += across + pull
        right += across @ camera.X0 + pull @ (camera.X0 - apart * axis)
    return np.asarray(np.linalg.solve(normal, right))
