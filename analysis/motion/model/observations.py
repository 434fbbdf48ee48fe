"""The measurements of a jump as arrays.

Every ray and every image line of a ski is one group of two observations: x and y of a point, or the distances of two
points of the ski's image from the axis. A weighted straight line is equivalent to two points with independent errors,
one root mean square distance before and behind its centroid; so any number of points on a ski becomes these two.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.measurements.model import (
    POINTS,
    SIDES,
    JumpMeasurements,
    Measurements,
    PointMeasurement,
    SkiMeasurement,
    Source,
)
from analysis.scene.camera_arrays import CameraArrays
from rig.arrays import Flags, Floats
from rig.clocks import NS_PER_S

#: What is measured in an image, in the order of the groups.
GROUPS: Final = (*POINTS, *SIDES)
_POINTS = len(POINTS)
_MEAN_AND_DIFFERENCE: Final = np.sqrt(0.5) * np.array(((1.0, 1.0), (1.0, -1.0)))
_SCATTER_P = 1e-3  # points of a ski that scatter more about their line than with this probability: sigma grows
_Place = tuple[int, int, int]  # pulse, camera, group


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
        lasting: (n, m, 6) px, standard deviation of a shift of both points of a ski, and of a turn, that neighbouring
            pulses share.
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


def observations(jump: JumpMeasurements, measurements: Measurements, cameras: CameraArrays) -> Observations:
    """Bring the measurements of a jump into arrays; those of other cameras than the given ones are left out."""
    n, m = len(jump.pulses), len(cameras.names)
    out = Observations(
        cameras.names,
        np.array([pulse.time - jump.pulses[0].time for pulse in jump.pulses], float) / NS_PER_S + measurements.middle_s,
        np.array([measurements.late_s(name) for name in cameras.names]),
        np.zeros((n, m, 6, 2, 2)),
        np.zeros((n, m, 6, 2, 2)),
        np.zeros((n, m, 6), bool),
        np.zeros((n, m, 6), bool),
        np.zeros((n, m, 6)),
        np.ones((6, 2)),
    )
    points: list[tuple[_Place, PointMeasurement]] = []
    skis: list[tuple[_Place, SkiMeasurement]] = []
    for k, pulse in enumerate(jump.pulses):
        for i, name in enumerate(cameras.names):
            if (image := pulse.images.get(name)) is None:
                continue
            for group, label in enumerate(POINTS):
                if (point := image.points.get(label)) is not None:
                    points.append(((k, i, group), point))
            for group, side in enumerate(SIDES, start=_POINTS):
                if (ski := image.skis.get(side)) is not None and len(ski.xy) >= 2:
                    skis.append(((k, i, group), ski))
    if points:
        xy = np.array([point.xy for _, point in points])[:, None].repeat(2, axis=1)
        _put(out, points, xy, np.array([point.covariance for _, point in points]))
    if skis:
        _put(out, skis, *_two_points(skis, cameras))
        out.lasting[tuple(np.transpose([at for at, _ in skis]))] = [ski.lasting for _, ski in skis]
    return out


def _put(
    out: Observations,
    measured: Sequence[tuple[_Place, PointMeasurement | SkiMeasurement]],
    xy: Floats,
    covariance: Floats,
) -> None:
    """Put g measured groups, of two points xy (g, 2, 2) each, in their places, unless they are not finite."""
    good = np.isfinite(xy).all(axis=(1, 2)) & np.isfinite(covariance).all(axis=(1, 2))
    at = tuple(np.transpose([place for place, _ in measured])[:, good])
    out.xy[at] = xy[good]
    out.whitener[at] = np.linalg.inv(np.linalg.cholesky(covariance[good]))
    out.seen[at] = True
    out.by_hand[at] = np.array([thing.source is Source.BY_HAND for _, thing in measured])[good]


def _two_points(skis: Sequence[tuple[_Place, SkiMeasurement]], cameras: CameraArrays) -> tuple[Floats, Floats]:
    """Two points (s, 2, 2) of each ski's image that stand for all of it, px, and covariances of their distances."""
    count = np.array([len(ski.xy) for _, ski in skis])
    camera = np.array([i for (_, i, _), _ in skis])
    ski, first = np.repeat(np.arange(len(skis)), count), np.cumsum(count) - count
    # Without distortion, where the skis are straight.
    flat = cameras.each(camera[ski]).reduced(np.concatenate([thing.xy for _, thing in skis]))
    weight = np.concatenate([thing.sigma for _, thing in skis]) ** -2.0

    def mean(values: Floats) -> Floats:
        """Weighted mean of each ski's points."""
        return np.asarray(np.add.reduceat(weight * values, first) / total)

    total = np.add.reduceat(weight, first)
    centre = np.stack((mean(flat[:, 0]), mean(flat[:, 1])), axis=-1)
    x, y = (flat - centre[ski]).T
    turn = np.arctan2(2 * mean(x * y), mean(x * x) - mean(y * y)) / 2
    axis = np.stack((np.cos(turn), np.sin(turn)), axis=-1)
    along, across = x * axis[ski, 0] + y * axis[ski, 1], y * axis[ski, 0] - x * axis[ski, 1]
    scatter, degrees = mean(across**2) * total, count - 2
    loose = (degrees > 0) & (scatter > chdtri(np.maximum(degrees, 1), _SCATTER_P))
    variance = 2.0 / total * np.where(loose, scatter / np.maximum(degrees, 1), 1.0)
    half = np.sqrt(mean(along**2))[:, None] * axis
    ends = np.stack((centre - half, centre + half), axis=1)
    common = np.array([thing.common for _, thing in skis])
    covariance = variance[:, None, None] * np.eye(2) + common[:, None, None] ** 2
    return cameras.each(np.repeat(camera, 2)).shown(ends.reshape(-1, 2)).reshape(ends.shape), covariance


def used_cameras(observed: Observations, used: Flags) -> list[Mapping[str, tuple[str, ...]]]:
    """Per pulse and group the cameras whose measurement was used; `used` has shape (n, m, 6)."""
    return [
        {group: tuple(name for i, name in enumerate(observed.names) if row[i, g]) for g, group in enumerate(GROUPS)}
        for row in used & observed.seen
    ]


def by_hand(observed: Observations, used: Flags) -> list[Mapping[str, bool]]:
    """Per pulse, by group whether a person measured any of what was used; `used` has shape (n, m, 6)."""
    rows = np.asarray((observed.by_hand & used).any(axis=1)).tolist()
    return [dict(zip(GROUPS, row, strict=True)) for row in rows]
