"""The pose of one image from points whose coordinates are uncertain too: least squares with the whole covariance.

The covariance of an image point is that of its measurement, plus the object point's, projected (paper, D3b, with the
object points eliminated), plus what the model leaves out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photogrammetry.geometry.camera_model import Lens, image_point, linearise
from photogrammetry.geometry.rotation import rotation_from_vector
from rig.arrays import Floats

_STEPS_MOST, _SETTLED_SQUARE = 15, 1e-8


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


@dataclass(frozen=True, slots=True, eq=False)
class Matched:
    """n object points and where an image shows them.

    Attributes:
        xyz: (n, 3) object points.
        xyz_covariance: (n, 3, 3).
        xy: (n, 2) metric image coordinates.
        xy_covariance: (n, 2, 2).
    """

    xyz: Floats
    xyz_covariance: Floats
    xy: Floats
    xy_covariance: Floats


def fit_poses(lens: Lens, starts: Sequence[SinglePose], matched: Sequence[Matched]) -> list[SinglePose | None]:
    """Fit several poses of one image, each to n >= 3 points of its own; None where they do not determine one near by.

    Args:
        lens: interior orientation.
        starts: of each; their covariances do not matter.
        matched: points of each.
    """
    fitted: list[SinglePose | None] = [None] * len(starts)
    if not starts:
        return fitted
    xyz, xyz_covariance, xy, xy_covariance = (
        _padded([getattr(one, name) for one in matched]) for name in Matched.__slots__
    )
    used = np.arange(xy.shape[1]) < np.array([len(one.xy) for one in matched])[:, None]
    position, rotation = np.array([s.position for s in starts]), np.array([s.rotation for s in starts])
    active = np.arange(len(starts))
    for _ in range(_STEPS_MOST):
        points, seen = xyz[active], used[active]
        v, by_pose, by_point = _at(lens, position[active], rotation[active], points, xy[active])
        total = xy_covariance[active] + by_point @ xyz_covariance[active] @ by_point.swapaxes(-1, -2)
        weight = np.where(seen[..., None, None], _inverses(total), 0.0)
        by_pose, v = np.where(seen[..., None, None], by_pose, 0.0), np.where(seen[..., None], v, 0.0)
        weighted = (weight @ by_pose).reshape(len(active), -1, 6).swapaxes(1, 2)
        normal = weighted @ by_pose.reshape(len(active), -1, 6)
        sound = np.asarray(np.isfinite(normal).all(axis=(1, 2)) & np.isfinite(weight).all(axis=(1, 2, 3)))
        sound &= np.linalg.det(np.where(sound[:, None, None], normal, 0.0)) != 0
        cofactors = np.linalg.inv(np.where(sound[:, None, None], normal, np.eye(6)))
        step = -(cofactors @ (weighted @ v.reshape(len(active), -1, 1)))[..., 0]
        sound &= np.isfinite(step).all(axis=1) & (np.abs(step[:, 3:]).max(axis=1) <= 1.0)
        active, step, cofactors, normal = active[sound], step[sound], cofactors[sound], normal[sound]
        position[active] += step[:, :3]
        rotation[active] = rotation[active] @ rotation_from_vector(step[:, 3:])
        settled = np.einsum("hi,hij,hj->h", step, normal, step) < _SETTLED_SQUARE
        for i, cofactor in zip(active[settled].tolist(), cofactors[settled], strict=True):
            fitted[i] = SinglePose(position[i].copy(), rotation[i].copy(), cofactor)
        active = active[~settled]
        if not len(active):
            break
    return fitted


def predict(lens: Lens, pose: SinglePose, xyz: Floats, xyz_covariance: Floats) -> tuple[Floats, Floats, Floats]:
    """Image points (n, 2), their covariance from the object points and, apart, from the pose: (n, 2, 2) each.

    NaN for points behind the camera.
    """
    xy, from_point, from_pose = predict_all(lens, [pose], xyz, xyz_covariance)
    return xy[0], from_point[0], from_pose[0]


def predict_all(
    lens: Lens, poses: Sequence[SinglePose], xyz: Floats, xyz_covariance: Floats
) -> tuple[Floats, Floats, Floats]:
    """The same points in each of h poses: (h, n, 2) and twice (h, n, 2, 2); see `predict`."""
    position, rotation = np.array([p.position for p in poses]), np.array([p.rotation for p in poses])
    spread = np.array([p.covariance for p in poses])[:, None]
    with np.errstate(all="ignore"):
        xy = image_point(lens, rotation[:, None], position[:, None], xyz)
    _, by_pose, by_point = _at(lens, position, rotation, np.broadcast_to(xyz, (*xy.shape[:2], 3)), xy)
    behind = np.einsum("hni,hi->hn", xyz - position[:, None], rotation[:, :, 2]) >= 0
    xy = np.where(behind[..., None], np.nan, xy)
    from_point = by_point @ xyz_covariance @ by_point.swapaxes(-1, -2)
    return xy, from_point, by_pose @ spread @ by_pose.swapaxes(-1, -2)


def _at(lens: Lens, position: Floats, rotation: Floats, xyz: Floats, xy: Floats) -> tuple[Floats, Floats, Floats]:
    """Residuals (h, n, 2) and derivatives (h, n, 2, 6) and (h, n, 2, 3) of points (h, n, 3) in h poses."""
    h, n, _ = xy.shape
    one = Lens(lens.interior[None], np.reshape(lens.balance, 1), np.reshape(lens.measured, 1))
    pose = np.repeat(np.arange(h), n)
    with np.errstate(all="ignore"):
        found = linearise(one, rotation[pose], position[pose], xyz.reshape(-1, 3), xy.reshape(-1, 2))
    return found.v.reshape(h, n, 2), found.by_pose.reshape(h, n, 2, 6), found.by_point.reshape(h, n, 2, 3)


def _padded(parts: Sequence[Floats]) -> Floats:
    """Arrays of different lengths as one, filled with each one's first element."""
    most = max(len(part) for part in parts)
    return np.array([np.concatenate((part, np.repeat(part[:1], most - len(part), axis=0))) for part in parts])


def _inverses(matrices: Floats) -> Floats:
    """Inverses of symmetric matrices (..., 2, 2); not finite where there is none."""
    a, b, d = matrices[..., 0, 0], matrices[..., 0, 1], matrices[..., 1, 1]
    with np.errstate(all="ignore"):
        inverse = np.stack((np.stack((d, -b), axis=-1), np.stack((-b, a), axis=-1)), axis=-2)
        return np.asarray(inverse / (a * d - b * b)[..., None, None])
