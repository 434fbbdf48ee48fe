"""Cameras as arrays, so that the images of all of them are computed at once.

A pulse or jump has few measurements in each image, and each call on arrays costs the same however small they are; so
one call for all cameras, not one for each, decides how fast points, skis and motions are computed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from analysis.scene.camera_system import CameraSystem, PlacedCamera
from photogrammetry.geometry.camera_model import (
    INTERIOR,
    Lens,
    camera_coordinates,
    distort,
    distortion,
    distortion_slope,
    ideal_point,
    linearise,
    undistort,
)
from photogrammetry.geometry.rotation import rotation_from_vector
from rig.arrays import Flags, Floats, Integers

_MIRROR = np.array([1.0, -1.0])  # pixel frame to metric frame
_POSE = 6
_OWN = _POSE + len(INTERIOR)
#: So many groups of cameras are kept as arrays: those of the logs that are measured by hand.
_KEPT: Final = 16


@dataclass(frozen=True, slots=True, eq=False)
class CameraArrays:
    """Cameras one after the other, or the camera of each of n observations.

    Attributes:
        names: of the cameras; none if there is one for each observation.
        lens: (m, ...) interior orientations.
        position: (m, 3) X0.
        rotation: (m, 3, 3), columns are the cameras' axes (Eq. A1).
        centre: (m, 2) px, of the images.
    """

    names: tuple[str, ...]
    lens: Lens
    position: Floats
    rotation: Floats
    centre: Floats

    @classmethod
    def of(cls, system: CameraSystem, names: Sequence[str]) -> "CameraArrays":
        """Some cameras of a system, in its order; names that it does not have are left out."""
        return cls.placed([system[name] for name in system.names if name in names])

    @classmethod
    def placed(cls, placed: Sequence[PlacedCamera]) -> "CameraArrays":
        """Cameras in this order."""
        lenses = [camera.camera.lens() for camera in placed]
        return cls(
            tuple(camera.name for camera in placed),
            Lens(
                np.array([lens.interior for lens in lenses]),
                np.array([lens.balance for lens in lenses]),
                np.array([lens.measured for lens in lenses]),
            ),
            np.array([camera.position for camera in placed]),
            np.array([camera.rotation for camera in placed]),
            np.array([(camera.size - 1) / 2 for camera in placed]),
        )

    def moved(self, step: Floats) -> "CameraArrays":
        """The cameras with their parameters changed by a step (m, 16), see `own_root`."""
        return replace(
            self,
            lens=replace(self.lens, interior=self.lens.interior + step[:, _POSE:]),
            position=self.position + step[:, :3],
            rotation=self.rotation @ rotation_from_vector(step[:, 3:_POSE]),
        )

    def each(self, numbers: Integers) -> "CameraArrays":
        """The camera of each observation, from the numbers (n,) of the cameras."""
        lens = Lens(self.lens.interior[numbers], self.lens.balance[numbers], self.lens.measured[numbers])
        return CameraArrays((), lens, self.position[numbers], self.rotation[numbers], self.centre[numbers])

    def in_turn(self, times: int, each: int = 1) -> "CameraArrays":
        """The camera of each observation: so many times all cameras in turn, each with so many observations."""
        return self.each(np.tile(np.repeat(np.arange(len(self.position)), each), times))

    def rays(self, xy: Floats) -> Floats:
        """Unit vectors (m, 3) in the object system from the cameras to what appears at xy (m, 2), px."""
        towards = np.concatenate((self.reduced(xy), -self.lens.interior[:, :1]), axis=1)
        unit = towards / np.linalg.norm(towards, axis=1, keepdims=True)
        return np.asarray((self.rotation @ unit[..., None])[..., 0])

    def reduced(self, xy: Floats) -> Floats:
        """Image coordinates (m, 2) without distortion and principal point, metric frame, from px (m, 2)."""
        return np.asarray(undistort(self.lens, self._metric(xy)), float)

    def shown(self, reduced: Floats) -> Floats:
        """Where the images show reduced coordinates (m, 2), px."""
        return np.asarray(distort(self.lens, reduced) * _MIRROR + self.centre, float)

    def linearised(self, xyz: Floats, xy: Floats) -> tuple[Floats, Floats, Floats]:
        """As `equations`, with NaN for v where a point is not before the camera."""
        v, by_point, by_own, before = self.equations(xyz, xy)
        return np.where(before[:, None], v, np.nan), by_point, by_own

    def equations(self, xyz: Floats, xy: Floats) -> tuple[Floats, Floats, Floats, Flags]:
        """Residuals of image points and their derivatives, px, pixel frame.

        Args:
            xyz: (m, 3) object points.
            xy: (m, 2) measured image points.

        Returns:
            v: (m, 2) computed - observed; derivatives by the object point (m, 2, 3), and by the camera's parameters
            (m, 2, 16) in the order of `own_root`; whether the points are before the camera (m,).
        """
        with np.errstate(all="ignore"):
            equations = linearise(self.lens, self.rotation, self.position, xyz, self._metric(xy))
        before = camera_coordinates(self.rotation, self.position, xyz)[:, 2] < 0
        by_own = np.concatenate((equations.by_pose, equations.by_interior), axis=-1)
        mirror = _MIRROR[:, None]
        return equations.v * _MIRROR, equations.by_point * mirror, by_own * mirror, np.asarray(before)

    def line(self, start: Floats, direction: Floats, xy: Floats) -> "CameraLine":
        """Straight lines in space as the cameras see them.

        Args:
            start: (m, 3) a point of each line.
            direction: (m, 3) its direction.
            xy: (m, 2) px, points measured in the images.
        """
        return CameraLine(
            self.lens,
            np.asarray(camera_coordinates(self.rotation, self.position, start), float),
            np.asarray(camera_coordinates(self.rotation, np.zeros(3), direction), float),
            self._metric(xy) - self.lens.interior[:, 1:3],
        )

    def _metric(self, xy: Floats) -> Floats:
        return np.asarray((xy - self.centre) * _MIRROR)


@dataclass(frozen=True, slots=True, eq=False)
class CameraLine:
    """Straight lines in the systems of the cameras that see them, and measured points of their images.

    Attributes:
        lens: (n, ...) of the cameras.
        start: (n, 3) camera coordinates of a point of each line.
        direction: (n, 3) of each line.
        reduced: (n, 2) measured points, metric frame, reduced to the principal point.
    """

    lens: Lens
    start: Floats
    direction: Floats
    reduced: Floats

    def at(self, along: Floats) -> tuple[Floats, Floats]:
        """Residuals of the measured points, and tangents of the images of the lines, at places (n,) along them.

        Returns:
            v: (n, 2) computed - observed, metric frame; NaN where a place is not before its camera; and the derivatives
            of the image points by the place (n, 2).
        """
        k = self.start + along[:, None] * self.direction
        c = self.lens.interior[:, 0]
        ideal = ideal_point(c, k)
        q = np.where(self.lens.measured[:, None], self.reduced, ideal)
        v = np.where(k[:, 2:] < 0, ideal + distortion(self.lens, q) - self.reduced, np.nan)
        tangent = -(c[:, None] * self.direction[:, :2] + ideal * self.direction[:, 2:]) / k[:, 2:]
        bent = (distortion_slope(self.lens, q) @ tangent[..., None])[..., 0]
        return np.asarray(v), np.asarray(tangent + np.where(self.lens.measured[:, None], 0.0, bent))


@lru_cache(_KEPT)
def stacked(cameras: tuple[PlacedCamera, ...], parameters: int) -> tuple[CameraArrays, Floats]:
    """Cameras as arrays, and which of so many uncertain parameters p are pose and interior of each: (m, 16, p)."""
    return CameraArrays.placed(cameras), _own(cameras, np.eye(parameters))


def own_root(system: CameraSystem, names: Sequence[str], root: Floats) -> Floats:
    """(m, 16, r): the rows of a root (p, r) of the covariance that belong to pose and interior of each camera.

    Rows of parameters that are certain are zero.
    """
    return _own([system[name] for name in names], root)


def _own(cameras: Sequence[PlacedCamera], root: Floats) -> Floats:
    out = np.zeros((len(cameras), _OWN, root.shape[1]))
    for i, placed in enumerate(cameras):
        uncertain = np.concatenate((np.arange(_POSE), _POSE + placed.interior))
        out[i, uncertain] = root[placed.columns]
    return out
