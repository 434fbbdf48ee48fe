"""The oriented cameras as measurements of the jumper need them: projection, derivatives, and one joint covariance.

All cameras of a recording were oriented together, so their errors are correlated, and all pulses share them. The joint
covariance of every pose and of every uncertain interior parameter goes with the cameras, so that each result can carry
it. Image coordinates are those of the log: px, pixel frame of `svev-network/1` (x right, y down).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.geometry.camera_model import (
    INTERIOR,
    Lens,
    camera_coordinates,
    distort,
    ideal_point,
    linearise,
    undistort,
)
from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.network.file import pixel_to_metric
from photogrammetry.network.model import Camera
from photogrammetry.procedures.orientation import Orientation
from rig.arrays import Flags, Floats, Integers

_MIRROR = np.array([1.0, -1.0])  # pixel frame to metric frame
_POSE = 6


@dataclass(frozen=True, slots=True, eq=False)
class PlacedCamera:
    """A camera with its interior and exterior orientation.

    Attributes:
        camera: interior orientation; its name is that in the log.
        position: (3,) X0.
        rotation: (3, 3), columns are the camera's axes (Eq. A1).
        interior: (k,) indices into `camera_model.INTERIOR` of the parameters that are uncertain.
        columns: (6 + k,) where X0, the turns about the camera's own axes and these parameters stand in the joint
            covariance.
    """

    camera: Camera
    position: Floats
    rotation: Floats
    interior: Integers
    columns: Integers

    @property
    def name(self) -> str:
        """Name of the camera, as in the log."""
        return self.camera.name

    @property
    def size(self) -> Floats:
        """(2,) width and height of its images, px."""
        return np.array(self.camera.size, float)

    def ideal(self) -> IdealCamera:
        """The camera without distortion, for closed solutions with `reduced` coordinates."""
        return IdealCamera(float(self.camera.interior[0]), self.position, self.rotation)

    def reduced(self, xy: ArrayLike) -> Floats:
        """Image coordinates (..., 2) without distortion and principal point, metric frame, from px (..., 2)."""
        return np.asarray(undistort(self.camera.lens(), pixel_to_metric(np.asarray(xy, float), self.size)), float)

    def project(self, xyz: ArrayLike) -> Floats:
        """Where object points (..., 3) appear, px (..., 2); NaN behind the camera."""
        lens, k = self.camera.lens(), camera_coordinates(self.rotation, self.position, np.asarray(xyz, float))
        with np.errstate(all="ignore"):
            metric = np.asarray(distort(lens, ideal_point(lens.interior[..., 0], k)), float)
        px = metric * _MIRROR + (self.size - 1) / 2
        px[~(k[..., 2] < 0)] = np.nan
        return np.asarray(px)

    def in_front(self, xyz: ArrayLike) -> Flags:
        """Whether object points (..., 3) lie before the camera."""
        return np.asarray(camera_coordinates(self.rotation, self.position, np.asarray(xyz, float))[..., 2] < 0)

    def shows(self, xyz: ArrayLike) -> Flags:
        """(n,) whether points (n, 3) lie within the image."""
        xy = self.project(xyz)
        with np.errstate(invalid="ignore"):
            return np.asarray(((xy >= 0) & (xy <= self.size - 1)).all(axis=-1))

    def shifted(self, px: Floats) -> "PlacedCamera":
        """The camera of a frame that shows everything so many px (2,) beside where this one shows it."""
        interior = self.camera.interior.copy()
        interior[[INTERIOR.index("x0"), INTERIOR.index("y0")]] += px * _MIRROR
        return replace(self, camera=replace(self.camera, interior=interior))

    def linearised(self, xyz: Floats, xy: Floats) -> tuple[Floats, Floats, Floats]:
        """Residuals of image points and their derivatives, px, pixel frame.

        Args:
            xyz: (n, 3) object points.
            xy: (n, 2) measured image points.

        Returns:
            v: (n, 2) computed - observed; derivatives by the object point (n, 2, 3), and by the camera's parameters
            (n, 2, 6 + k) in the order of `columns`.
        """
        lens = self.camera.lens()
        lens = Lens(lens.interior[None], np.asarray(lens.balance)[None], np.asarray(lens.measured)[None])
        metric = pixel_to_metric(np.asarray(xy, float), self.size)
        equations = linearise(lens, self.rotation[None], self.position[None], xyz, metric)
        by_parameters = np.concatenate((equations.by_pose, equations.by_interior[..., self.interior]), axis=-1)
        mirror = _MIRROR[:, None]
        return equations.v * _MIRROR, equations.by_point * mirror, by_parameters * mirror


@dataclass(frozen=True, slots=True, eq=False)
class CameraSystem:
    """The oriented cameras of a recording.

    Attributes:
        cameras: by name, in the order of the log.
        covariance: (p, p) of all their uncertain parameters; see `PlacedCamera.columns`.
        given: (p, p) the part of the covariance that comes from what was given, survey and interior orientation, not
            from the images: other recordings that were oriented with the same share it. None if it is not known.
    """

    cameras: Mapping[str, PlacedCamera]
    covariance: Floats
    given: Floats | None = None

    def __getitem__(self, name: str) -> PlacedCamera:
        return self.cameras[name]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cameras."""
        return tuple(self.cameras)

    def only(self, names: Sequence[str]) -> "CameraSystem":
        """Some of the cameras, in this order, with their part of the covariance."""
        columns = np.concatenate([self[name].columns for name in names])
        placed, first = {}, 0
        for name in names:
            end = first + len(self[name].columns)
            placed[name] = replace(self[name], columns=np.arange(first, end))
            first = end
        given = None if self.given is None else self.given[np.ix_(columns, columns)]
        return CameraSystem(placed, self.covariance[np.ix_(columns, columns)], given)

    def moved(self, step: Floats) -> "CameraSystem":
        """The cameras with all uncertain parameters (p,) changed by `step`; the covariance stays.

        For draws of the calibration, and for adjustments that estimate the parameters.
        """
        return replace(self, cameras={name: _moved(placed, step) for name, placed in self.cameras.items()})


def camera_system(orientation: Orientation, order: Sequence[str]) -> CameraSystem:
    """The cameras of an orientation that has one image of each camera, with their a-posteriori covariance.

    Args:
        orientation: the adjusted network.
        order: names of the cameras in the log; those that are not oriented are left out.
    """
    a = orientation.outcome.adjustment
    unknowns = a.problem.unknowns
    images = {a.network.cameras[image.camera].name: i for i, image in enumerate(a.network.images)}
    placed: dict[str, PlacedCamera] = {}
    columns: list[Integers] = []
    for name in order:
        if name not in images:
            continue
        image = images[name]
        index = a.network.images[image].camera
        of_camera = unknowns.camera[index]
        uncertain = of_camera >= 0
        first = sum(len(c) for c in columns)
        columns.append(np.concatenate((unknowns.pose[image], of_camera[uncertain])))
        placed[name] = PlacedCamera(
            replace(a.network.cameras[index], interior=a.state.interior[index]),
            a.state.position[image],
            a.state.rotation[image],
            unknowns.selection[uncertain],
            np.arange(first, first + len(columns[-1])),
        )
    chosen = np.concatenate(columns)
    return CameraSystem(placed, a.covariance(chosen), _of_given(a, chosen))


def _of_given(a: Adjustment, columns: Integers) -> Floats:
    """The part of the covariance of unknowns that comes from surveyed coordinates and given interior orientation.

    Each is an observation of one unknown i with a weight w, so that its part is the sum of w C_i C_i', with the column
    C_i of the cofactors.
    """
    unknowns, relations = a.problem.unknowns, a.problem.relations
    place = {int(parameter): k for k, parameter in enumerate(unknowns.selection)}
    control, interior = relations.rows(Kind.CONTROL), relations.rows(Kind.CAMERA)
    observed = [int(unknowns.point[relations.item[i], relations.part[i]]) for i in control]
    observed += [int(unknowns.camera[relations.item[i], place[int(relations.part[i])]]) for i in interior]
    sigma = a.problem.relation_sigma[np.concatenate((control, interior))] * a.scale
    free = np.array(observed, np.intp) >= 0
    rows = np.array(observed, np.intp)[free]
    cross = a.covariance(np.concatenate((columns, rows)))[: len(columns), len(columns) :] / sigma[free]
    return np.asarray(cross @ cross.T)


def _moved(placed: PlacedCamera, step: Floats) -> PlacedCamera:
    own = step[placed.columns]
    interior = placed.camera.interior.copy()
    interior[placed.interior] += own[_POSE:]
    return replace(
        placed,
        camera=replace(placed.camera, interior=interior),
        position=placed.position + own[:3],
        rotation=placed.rotation @ rotation_from_vector(own[3:_POSE]),
    )
