"""The measurements of a jump as arrays, and their linearised error equations.

Every ray and every image line of a ski is one group of two observations: x and y of a point, or the distances of two
points of the ski's image from the axis. A weighted straight line is equivalent to two points with independent errors,
one root mean square distance before and behind its centroid; so any number of points on a ski becomes these two.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.measurements.model import POINTS, SIDES, JumpMeasurements, Measurements, SkiMeasurement, Source
from analysis.motion.channels import CHANNELS, MotionFrame
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from rig.arrays import Flags, Floats
from rig.clocks import NS_PER_S

#: What is measured in an image, in the order of the groups.
GROUPS: Final = (*POINTS, *SIDES)
_POINTS = len(POINTS)
_BINDINGS = slice(2, 4)  # P3 and P4 lie on the right and on the left ski
_MEAN_AND_DIFFERENCE: Final = np.sqrt(0.5) * np.array(((1.0, 1.0), (1.0, -1.0)))
_SCATTER_P = 1e-3  # points of a ski that scatter more about their line than with this probability: sigma grows
_FOOT_STEPS = 3  # iterations for the point of a ski that is nearest to a measured one
_FARTHEST_M = 5.0  # along a ski; its points are within half its length of the binding


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """The measurements of a jump: n pulses, m cameras, six groups (P1..P4, right, left ski) of two.

    Attributes:
        names: of the cameras.
        times: (n,) s, of the middle of the cameras' mean exposure, from the first pulse on.
        delay: (m,) s, by which the middle of a camera's exposure is later than that.
        xy: (n, m, 6, 2, 2) px: measured point (the second axis of four: twice the same), or the ski's two points.
        whitener: (n, m, 6, 2, 2): root of the weight matrix of a group's two observations.
        seen: (n, m, 6) which groups were measured.
        by_hand: (n, m, 6) which of them a person measured.
        lasting: (n, m, 6) px, standard deviation of a shift of both points of a ski that neighbouring pulses share.
        factors: (6, 2) by which the standard deviations of the measurements were changed, see `scaled`.
    """

    names: tuple[str, ...]
    times: Floats
    delay: Floats
    xy: Floats
    whitener: Floats
    seen: Flags
    by_hand: Flags
    lasting: Floats
    factors: Floats

    @property
    def shape(self) -> tuple[int, int]:
        """Number of pulses and of cameras."""
        return self.seen.shape[0], self.seen.shape[1]

    def part(self, pulses: slice) -> "Observations":
        """Those of some pulses."""
        arrays = {
            name: getattr(self, name)[pulses] for name in ("times", "xy", "whitener", "seen", "by_hand", "lasting")
        }
        return replace(self, **arrays)

    def to_mean_and_difference(self) -> Floats:
        """Rotations (n, m, 6, 2, 2) of whitened observations to their normalized mean and difference.

        These are independent where two observations have equal variances, as those of a ski have.
        """
        white = np.where(self.seen[..., None, None], self.whitener, np.eye(2))
        apart = _MEAN_AND_DIFFERENCE @ np.linalg.inv(white)
        return np.asarray(apart / np.linalg.norm(apart, axis=-1, keepdims=True))

    def scaled(self, factors: Floats) -> "Observations":
        """The same with other standard deviations.

        Args:
            factors: (6, 2) of each kind of group, for the mean and for the difference of its two observations: by how
                much a ski's axis is shifted, and turned.
        """
        inverse = np.einsum("ab,gb,cb->gac", _MEAN_AND_DIFFERENCE, 1 / factors, _MEAN_AND_DIFFERENCE)
        return replace(
            self,
            whitener=self.whitener @ inverse,
            lasting=self.lasting * factors[:, 0],
            factors=self.factors * factors,
        )


def observations(jump: JumpMeasurements, measurements: Measurements, system: CameraSystem) -> Observations:
    """Bring the measurements of a jump into arrays; cameras that are not oriented are left out."""
    names = tuple(name for name in system.names if name in measurements.cameras)
    n, m = len(jump.pulses), len(names)
    out = Observations(
        names,
        np.array([pulse.time - jump.pulses[0].time for pulse in jump.pulses], float) / NS_PER_S + measurements.middle_s,
        np.array([measurements.late_s(name) for name in names]),
        np.zeros((n, m, 6, 2, 2)),
        np.zeros((n, m, 6, 2, 2)),
        np.zeros((n, m, 6), bool),
        np.zeros((n, m, 6), bool),
        np.zeros((n, m, 6)),
        np.ones((6, 2)),
    )
    for i, name in enumerate(names):
        skis: list[tuple[tuple[int, int, int], SkiMeasurement]] = []
        for k, pulse in enumerate(jump.pulses):
            if (image := pulse.images.get(name)) is None:
                continue
            for group, label in enumerate(POINTS):
                if (point := image.points.get(label)) is not None:
                    _put(out, (k, i, group), np.stack((point.xy, point.xy)), point.covariance, point.source)
            for group, side in enumerate(SIDES, start=_POINTS):
                if (ski := image.skis.get(side)) is not None and len(ski.xy) >= 2:
                    skis.append(((k, i, group), ski))
        for (at, ski), ends, covariance in zip(skis, *_two_points([ski for _, ski in skis], system[name]), strict=True):
            _put(out, at, ends, covariance, ski.source)
            out.lasting[at] = ski.lasting
    return out


def _put(out: Observations, at: tuple[int, int, int], xy: Floats, covariance: Floats, source: Source) -> None:
    if not (np.isfinite(xy).all() and np.isfinite(covariance).all()):
        return
    out.xy[at] = xy
    out.whitener[at] = np.linalg.inv(np.linalg.cholesky(covariance))
    out.seen[at] = True
    out.by_hand[at] = source is Source.BY_HAND


def _two_points(skis: Sequence[SkiMeasurement], placed: PlacedCamera) -> tuple[Floats, Floats]:
    """Two points (n, 2, 2) of each ski's image that stand for all of it, px, and covariances of their distances."""
    if not skis:
        return np.empty((0, 2, 2)), np.empty((0, 2, 2))
    flat = placed.reduced(np.concatenate([ski.xy for ski in skis]))  # without distortion, where the skis are straight
    parts = np.split(flat, np.cumsum([len(ski.xy) for ski in skis])[:-1])
    fitted = [_straight(part, ski) for part, ski in zip(parts, skis, strict=True)]
    ends = np.stack([of_ski for of_ski, _ in fitted])
    depth = np.broadcast_to(placed.camera.interior[0], (len(skis), 2, 1))
    rays = np.concatenate((ends, -depth), axis=-1) @ placed.rotation.T
    return placed.project(placed.position + rays), np.stack([covariance for _, covariance in fitted])


def _straight(flat: Floats, ski: SkiMeasurement) -> tuple[Floats, Floats]:
    """The two points (2, 2) of one ski, reduced, and the covariance (2, 2) of their distances from the axis."""
    weight = ski.sigma**-2.0
    centre = weight @ flat / weight.sum()
    off = flat - centre
    axis = np.linalg.eigh((off * weight[:, None]).T @ off)[1][:, 1]
    along, across = off @ axis, off @ np.array((-axis[1], axis[0]))
    degrees = len(flat) - 2
    scatter = float(weight @ across**2)
    factor = scatter / degrees if degrees and scatter > chdtri(degrees, _SCATTER_P) else 1.0
    spread = np.sqrt(weight @ along**2 / weight.sum())
    ends = centre + np.array((-spread, spread))[:, None] * axis
    return ends, 2.0 * factor / weight.sum() * np.eye(2) + ski.common**2


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """Error equations, divided by the standard deviations: each observation has the weight 1.

    Attributes:
        v: (n, m, 6, 2) computed - observed; 0 where nothing was measured.
        by_channels: (n, m, 6, 2, 16) derivatives by the channels at the camera's own time.
        by_camera: (n, m, 6, 2, p) derivatives by the uncertain parameters of all cameras.
    """

    v: Floats
    by_channels: Floats
    by_camera: Floats


def linearised(observed: Observations, system: CameraSystem, frame: MotionFrame, channels: Floats) -> Equations:
    """The error equations at channels (n, m, 16): at each pulse as each camera sees it."""
    n, m = observed.shape
    v = np.zeros((n, m, 6, 2))
    by_channels = np.zeros((n, m, 6, 2, CHANNELS))
    by_camera = np.zeros((n, m, 6, 2, len(system.covariance)))
    points, of_points = frame.points(channels), frame.point_jacobian()
    skis, of_skis = frame.skis(channels), frame.ski_jacobian(channels)
    for i, name in enumerate(observed.names):
        placed = system[name]
        xy = observed.xy[:, i]
        residuals, by_point, by_own = _at(placed, points[:, i], xy[:, :_POINTS, 0])
        v[:, i, :_POINTS] = residuals
        by_channels[:, i, :_POINTS] = np.einsum("nlri,lik->nlrk", by_point, of_points)
        by_camera[:, i, :_POINTS, :, placed.columns] = np.moveaxis(by_own, -1, 0)
        line = _axis_distances(placed, points[:, i, _BINDINGS], skis[:, i], xy[:, _POINTS:])
        v[:, i, _POINTS:] = line.v
        by_channels[:, i, _POINTS:] = np.einsum("nsri,sik->nsrk", line.by_point, of_points[_BINDINGS]) + np.einsum(
            "nsri,nsik->nsrk", line.by_point * line.along[..., None], of_skis[:, i]
        )
        by_camera[:, i, _POINTS:, :, placed.columns] = np.moveaxis(line.by_own, -1, 0)
    good = observed.seen & np.isfinite(v).all(axis=-1)
    white = np.where(good[..., None, None], observed.whitener, 0.0)
    return Equations(*(_whitened(white, array) for array in (v[..., None], by_channels, by_camera)))


def _whitened(white: Floats, rows: Floats) -> Floats:
    out = white @ np.where(np.isfinite(rows), rows, 0.0)
    return out[..., 0] if out.shape[-1] == 1 else out


@dataclass(frozen=True, slots=True, eq=False)
class _Lines:
    """Distances of measured points from the images of the skis (n, 2, 2) and their derivatives."""

    v: Floats
    by_point: Floats
    by_own: Floats
    along: Floats


def _axis_distances(placed: PlacedCamera, binding: Floats, direction: Floats, xy: Floats) -> _Lines:
    along = np.zeros(xy.shape[:-1])
    for step in range(_FOOT_STEPS + 1):
        spots = binding[:, :, None] + along[..., None] * direction[:, :, None]
        v, by_point, by_own = _at(placed, spots, xy)
        tangent = np.einsum("nspri,nsi->nspr", by_point, direction)
        if step < _FOOT_STEPS:
            with np.errstate(all="ignore"):
                along = along - (tangent * v).sum(axis=-1) / (tangent**2).sum(axis=-1)
            along = np.clip(np.nan_to_num(along), -_FARTHEST_M, _FARTHEST_M)
    with np.errstate(all="ignore"):
        normal = np.stack((-tangent[..., 1], tangent[..., 0]), axis=-1) / np.linalg.norm(tangent, axis=-1)[..., None]
    return _Lines(
        np.einsum("nspr,nspr->nsp", normal, v),
        np.einsum("nspr,nspri->nspi", normal, by_point),
        np.einsum("nspr,nsprk->nspk", normal, by_own),
        along,
    )


def _at(placed: PlacedCamera, xyz: Floats, xy: Floats) -> tuple[Floats, Floats, Floats]:
    """`PlacedCamera.linearised` for points (..., 3); NaN where they are not before the camera."""
    with np.errstate(all="ignore"):
        v, by_point, by_own = placed.linearised(xyz.reshape(-1, 3), xy.reshape(-1, 2))
    v = np.where(placed.in_front(xyz.reshape(-1, 3))[:, None], v, np.nan)
    return tuple(a.reshape(*xyz.shape[:-1], *a.shape[1:]) for a in (v, by_point, by_own))  # type: ignore[return-value]


def used_cameras(observed: Observations, used: Flags) -> list[Mapping[str, tuple[str, ...]]]:
    """Per pulse and group the cameras whose measurement was used; `used` has shape (n, m, 6)."""
    return [
        {group: tuple(name for i, name in enumerate(observed.names) if row[i, g]) for g, group in enumerate(GROUPS)}
        for row in used & observed.seen
    ]
