"""The linearised error equations of the measurements of a jump."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.measurements.model import POINTS
from analysis.motion.model.channels import CHANNELS, VECTORS, MotionFrame
from analysis.motion.model.observations import GROUPS, Observations
from analysis.scene.camera_arrays import CameraArrays
from rig.arrays import Floats, Integers

_POINTS = len(POINTS)
#: The point that each group's equations begin with: P3 and P4 lie on the right and on the left ski.
_BEGIN: Final = np.array((0, 1, 2, 3, 2, 3))
_ENDS = 4  # measured points of skis: two of each
_FOOT_STEPS = 3  # iterations for the point of a ski that is nearest to a measured one
_FARTHEST_M = 5.0  # along a ski; its points are within half its length of the binding


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """Error equations, divided by the standard deviations: each observation has the weight 1.

    Attributes:
        v: (n, m, 6, 2) computed - observed; 0 where nothing was measured.
        by_channels: (n, m, 6, 2, 16) derivatives by the channels at the camera's own time.
        by_u: (n, m, 6, 2, r) derivatives by the uncertain parameters u of all cameras, see `own_root`.
    """

    v: Floats
    by_channels: Floats
    by_u: Floats


def linearised(
    observed: Observations, cameras: CameraArrays, root: Floats, frame: MotionFrame, channels: Floats
) -> Equations:
    """The error equations of all cameras at once.

    Args:
        observed: the measurements.
        cameras: the m cameras.
        root: (m, 16, r) of the covariance of their parameters, see `own_root`.
        frame: of the motion.
        channels: (n, m, 16) at each pulse as each camera sees it.
    """
    n, m = observed.shape
    points, skis = frame.points(channels), frame.skis(channels)
    ends = observed.xy[:, :, _POINTS:].reshape(n, m, _ENDS, 2)
    start, direction = points[:, :, _BEGIN[_POINTS:]].repeat(2, axis=2), skis.repeat(2, axis=2)
    along = _feet(cameras.each(_numbers(n, m, _ENDS)), start, direction, ends)[..., None]
    xyz = np.concatenate((points, start + along * direction), axis=2)
    xy = np.concatenate((observed.xy[:, :, :_POINTS, 0], ends), axis=2)
    v, by_xyz, by_own = (
        part.reshape(n, m, _POINTS + _ENDS, 2, -1)
        for part in cameras.each(_numbers(n, m, _POINTS + _ENDS)).linearised(xyz.reshape(-1, 3), xy.reshape(-1, 2))
    )
    across = _across(by_xyz[:, :, _POINTS:], direction)
    v, by_xyz, by_own = (_by_group(part, across) for part in (v, by_xyz, by_own))
    by_turn = by_xyz[:, :, _POINTS:] * along.reshape(n, m, -1, 2, 1)
    good = observed.seen & np.isfinite(v).all(axis=(-2, -1))
    white = np.where(good[..., None, None], observed.whitener, 0.0)
    v, by_xyz, by_own = (_whitened(white, part) for part in (v, by_xyz, by_own))
    by_channels = np.empty((n, m, len(GROUPS), 2, CHANNELS))
    by_channels[..., :VECTORS] = frame.by_vectors(by_xyz, _BEGIN)
    by_channels[:, :, :_POINTS, :, VECTORS:] = 0.0
    by_channels[:, :, _POINTS:, :, VECTORS:] = _whitened(white[:, :, _POINTS:], by_turn) @ frame.by_skis(channels)
    by_u = by_own.reshape(n, m, 2 * len(GROUPS), -1) @ root
    return Equations(v[..., 0], by_channels, by_u.reshape(n, m, len(GROUPS), 2, -1))


def _whitened(white: Floats, rows: Floats) -> Floats:
    return np.asarray(white @ np.where(np.isfinite(rows), rows, 0.0))


def _numbers(n: int, m: int, count: int) -> Integers:
    """The camera of each of so many points in each image."""
    return np.tile(np.repeat(np.arange(m), count), n)


def _feet(cameras: CameraArrays, start: Floats, direction: Floats, ends: Floats) -> Floats:
    """How far along the skis (n, m, 4) from the bindings the points lie whose images are nearest to measured ones."""
    line = cameras.line(start.reshape(-1, 3), direction.reshape(-1, 3), ends.reshape(-1, 2))
    along = np.zeros(len(line.reduced))
    with np.errstate(all="ignore"):
        for _ in range(_FOOT_STEPS):
            v, tangent = line.at(along)
            along = along - (tangent * v).sum(axis=-1) / (tangent**2).sum(axis=-1)
            along = np.clip(np.nan_to_num(along), -_FARTHEST_M, _FARTHEST_M)
    return along.reshape(ends.shape[:-1])


def _across(by_xyz: Floats, direction: Floats) -> Floats:
    """Unit vectors (n, m, 4, 1, 2) in the images across the skis, from derivatives (n, m, 4, 2, 3) of their points."""
    tangent = (by_xyz @ direction[..., None])[..., 0]
    with np.errstate(all="ignore"):
        normal = (
            np.stack((-tangent[..., 1], tangent[..., 0]), axis=-1) / np.hypot(*np.moveaxis(tangent, -1, 0))[..., None]
        )
    return np.asarray(normal[..., None, :])


def _by_group(parts: Floats, across: Floats) -> Floats:
    """(n, m, 6, 2, k) from both coordinates (n, m, 8, 2, k) of four markers and of four points of skis."""
    n, m, _, _, k = parts.shape
    skis = (across @ parts[:, :, _POINTS:]).reshape(n, m, _ENDS // 2, 2, k)
    return np.concatenate((parts[:, :, :_POINTS], skis), axis=2)
