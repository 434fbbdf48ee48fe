"""The pose of one image from points whose coordinates are uncertain too: least squares with the whole covariance.

The covariance of an image point is that of its measurement plus that of the object point, projected (paper, D3b, with
the object points eliminated), plus what the model leaves out.
"""

from dataclasses import dataclass

import numpy as np

from photogrammetry.geometry.camera_model import Lens, image_point, linearise
from photogrammetry.geometry.rotation import rotation_from_vector
from rig.arrays import Floats

_STEPS, _ENOUGH = 15, 1e-8


@dataclass(frozen=True, slots=True, eq=False)
class SinglePose:
    """Pose of one image.

    Attributes:
        position: (3,) X0.
        rotation: (3, 3).
        covariance: (6, 6) a priori, of X0 and of turns about the camera's axes.
    """

    position: Floats
    rotation: Floats
    covariance: Floats


def fit_pose(
    lens: Lens, start: SinglePose, xyz: Floats, xyz_covariance: Floats, xy: Floats, xy_covariance: Floats
) -> SinglePose | None:
    """Fit a pose to n >= 3 points; None if they do not determine one near the start.

    Args:
        lens: interior orientation.
        start: its covariance does not matter.
        xyz: (n, 3) object points.
        xyz_covariance: (n, 3, 3).
        xy: (n, 2) metric image coordinates.
        xy_covariance: (n, 2, 2).
    """
    position, rotation = start.position, start.rotation
    for _ in range(_STEPS):
        v, by_pose, by_point = _at(lens, position, rotation, xyz, xy)
        weight = np.linalg.inv(xy_covariance + by_point @ xyz_covariance @ by_point.transpose(0, 2, 1))
        if not np.isfinite(weight).all():
            return None
        normal = np.einsum("nia,nij,njb->ab", by_pose, weight, by_pose)
        try:
            cofactors = np.linalg.inv(normal)
        except np.linalg.LinAlgError:
            return None
        step = -cofactors @ np.einsum("nia,nij,nj->a", by_pose, weight, v)
        if not np.isfinite(step).all() or np.abs(step[3:]).max() > 1.0:
            return None
        position, rotation = position + step[:3], rotation @ rotation_from_vector(step[3:])
        if float(step @ normal @ step) < _ENOUGH:
            return SinglePose(position, rotation, cofactors)
    return None


def predict(lens: Lens, pose: SinglePose, xyz: Floats, xyz_covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """Image points (n, 2), their covariance from the object points and, apart, from the pose: (n, 2, 2) each.

    NaN for points behind the camera.
    """
    with np.errstate(all="ignore"):
        xy = image_point(lens, pose.rotation, pose.position, xyz)
    _, by_pose, by_point = _at(lens, pose.position, pose.rotation, xyz, xy)
    behind = (xyz - pose.position) @ pose.rotation[:, 2] >= 0
    xy = np.where(behind[:, None], np.nan, xy)
    from_point = by_point @ xyz_covariance @ by_point.transpose(0, 2, 1)
    return xy, from_point, by_pose @ pose.covariance @ by_pose.transpose(0, 2, 1)


def _at(lens: Lens, position: Floats, rotation: Floats, xyz: Floats, xy: Floats) -> tuple[Floats, Floats, Floats]:
    one = Lens(lens.interior[None], np.reshape(lens.balance, 1), np.reshape(lens.measured, 1))
    with np.errstate(all="ignore"):
        found = linearise(one, rotation[None], position[None], xyz, xy)
    return found.v, found.by_pose, found.by_point
