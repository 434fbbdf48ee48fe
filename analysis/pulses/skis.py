"""Skis as lines in space: image lines of all pulses, their start values and their equations.

A line has a point and a unit direction, and four local parameters: shifts of the point along two axes across the line,
and turns of the direction towards them. So it may run anywhere, unlike (C8), which expects it near the X axis. The
points measured on one image of a ski give two observations: the mean distance from the projected line, and the turn.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.measurements.model import SIDES, PulseMeasurements, Source
from analysis.pulses.least_squares import Equations
from analysis.pulses.points import nearest, of_objects
from analysis.scene.camera_arrays import stacked
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from photogrammetry.geometry.rotation import cross
from rig.arrays import Flags, Floats, Integers

_LARGEST_IMAGE_TURN = 0.1  # rad, sigma of the direction of an image line: with a larger one it is a point


@dataclass(frozen=True, slots=True, eq=False)
class SkiLines:
    """n skis in m images of k points: state (n, 6) a point on the line and its unit direction.

    Attributes:
        cameras: the m cameras.
        parameters: number p of their uncertain parameters.
        xy: (n, m, k, 2) px.
        ray: (n, m, k, 3) unit vectors from the cameras to what appears there.
        weight: (n, m, k) 1 / sigma^2 across the ski, px^-2; 0 where there is no point.
        common: (n, m) standard deviation across the ski that the points of an image share, px.
        seen: (n, m).
        by_hand: (n, m).
        shift: (n, m, 3) how much farther the jumper was when the camera saw it than at the instant of the result, m.
        spread: (n, m, 3) standard deviation of the shift, along the way, m.
    """

    cameras: Sequence[PlacedCamera]
    parameters: int
    xy: Floats
    ray: Floats
    weight: Floats
    common: Floats
    seen: Flags
    by_hand: Flags
    shift: Floats
    spread: Floats

    def start(self, seen: Flags) -> Floats:
        """Lines that meet the planes through projection centres and image lines best (C.3)."""
        n = len(seen)
        position = np.array([camera.position for camera in self.cameras])
        centroid = position.mean(axis=0)
        ray = np.where(self.weight[..., None] > 0, self.ray, 0.0)
        normal = np.where(seen[..., None], np.linalg.eigh(np.swapaxes(ray, 2, 3) @ ray)[1][..., 0], 0.0)
        centre = position - centroid - self.shift
        scatter = np.swapaxes(normal, 1, 2) @ normal
        target = (normal * (normal * centre).sum(axis=2, keepdims=True)).sum(axis=1)
        first = seen.argmax(axis=1)
        start, sight = centre[np.arange(n), first], ray[np.arange(n), first].sum(axis=1)
        values, vectors = np.linalg.eigh(scatter)
        direction, planes = vectors[:, :, 0], vectors[:, :, 1:]
        within = np.where(values[:, 1:] > 0, 1 / values[:, 1:], 0.0)
        foot = np.einsum("nij,nj,nkj,nk->ni", planes, within, planes, target)
        return np.concatenate((_nearest_on_line(foot, direction, start, _unit(sight)) + centroid, direction), axis=1)

    def equations(self, state: Floats) -> Equations:
        """Distances of the measured points from the projected line, reduced to mean and turn for each image."""
        n, m, k, _ = self.xy.shape
        cameras, own = stacked(tuple(self.cameras), self.parameters)
        origin, direction = state[:, None, None, :3] + self.shift[:, :, None], state[:, None, None, 3:]
        there = _nearest_on_line(origin, direction, cameras.position[:, None], self.ray)
        parts = cameras.in_turn(n, k).equations(there.reshape(-1, 3), self.xy.reshape(-1, 2))
        v, by_point, by_own, before = (part.reshape(n, m, k, *part.shape[1:]) for part in parts)
        tangent = _unit((by_point @ state[:, None, None, 3:, None])[..., 0])
        normal = np.stack((-tangent[..., 1], tangent[..., 0]), axis=-1)
        across = (normal[..., None, :] @ by_point)[..., 0, :]
        one, other = across_axes(state[:, 3:])
        lever = ((there - origin) * direction).sum(axis=-1)
        on_one, on_other = (across * one[:, None, None]).sum(axis=-1), (across * other[:, None, None]).sum(axis=-1)
        design = np.stack((on_one, on_other, lever * on_one, lever * on_other), axis=-1)
        gain, covariance = self._reduction(tangent)
        off = gain @ (across @ self.spread[..., None])
        return Equations(
            (gain @ (normal * v).sum(axis=-1)[..., None])[..., 0],
            gain @ design,
            gain @ (normal[..., None, :] @ by_own)[..., 0, :] @ own,
            covariance + off * off.swapaxes(2, 3),
            np.asarray((before | (self.weight == 0)).all(axis=2)),
        )

    def _reduction(self, tangent: Floats) -> tuple[Floats, Floats]:
        """From distances across the line to their weighted mean and turn: gains (n, m, 2, k), covariance (n, m, 2, 2).

        The turn is given as the distance that it makes at the points' root mean square distance from their centre.
        """
        xy, weight = self.xy, self.weight
        total = weight.sum(axis=2, keepdims=True)
        total = np.where(total > 0, total, 1.0)
        centre = (weight[..., None] * xy).sum(axis=2, keepdims=True) / total[..., None]
        axis = _unit((weight[..., None] * tangent).sum(axis=2, keepdims=True))
        along = ((xy - centre) * axis).sum(axis=-1)
        along = along / np.sqrt((weight * along**2).sum(axis=2, keepdims=True) / total)
        gain = np.stack((weight / total, weight * along / total), axis=2)
        covariance = np.zeros((*total.shape[:2], 2, 2))
        covariance[..., 0, 0] = 1 / total[..., 0] + self.common**2
        covariance[..., 1, 1] = 1 / total[..., 0]
        return gain, covariance

    def moved(self, state: Floats, step: Floats) -> Floats:
        """Lines (n, 6) changed by steps (n, 4) of their local parameters."""
        one, other = across_axes(state[:, 3:])
        origin = state[:, :3] + step[:, :1] * one + step[:, 1:2] * other
        return np.concatenate((origin, _unit(state[:, 3:] + step[:, 2:3] * one + step[:, 3:] * other)), axis=1)

    def reach(self, state: Floats) -> Floats:
        """The distance from the nearest camera, and one radian."""
        distance = nearest(self.cameras, state[:, :3], self.seen)
        return np.stack((distance, distance, np.ones(len(state)), np.ones(len(state))), axis=1)

    def scaled(self, factor: float) -> "SkiLines":
        """The same with all standard deviations of the image measurement times a factor."""
        return replace(self, weight=self.weight / factor**2, common=self.common * factor)

    def sigma(self) -> float:
        """Median standard deviation of the image lines across the ski, px."""
        variance = 1 / self.weight[self.seen].sum(axis=-1) + self.common[self.seen] ** 2
        return float(np.sqrt(np.median(variance))) if len(variance) else 0.0

    def subset(self, rows: Integers) -> "SkiLines":
        """The skis `rows`, which may repeat."""
        return replace(
            self,
            xy=self.xy[rows],
            ray=self.ray[rows],
            weight=self.weight[rows],
            common=self.common[rows],
            seen=self.seen[rows],
            by_hand=self.by_hand[rows],
            shift=self.shift[rows],
            spread=self.spread[rows],
        )

    def interchanged(self, image: int) -> "SkiLines":
        """The skis with right and left interchanged in one image; they stand in turn, as `skis_of` puts them."""
        other = np.arange(len(self.seen)) ^ 1
        result = self.subset(np.arange(len(self.seen)))
        for array in (result.xy, result.ray, result.weight, result.common, result.seen, result.by_hand):
            array[:, image] = array[other, image]
        return result


def skis_of(
    system: CameraSystem, pulses: Sequence[PulseMeasurements], shift: Floats | None = None, spread: Floats | None = None
) -> SkiLines:
    """All skis of a jump: right and left one of the first pulse, then of the next.

    Args:
        system: m oriented cameras; measurements of others are left out.
        pulses: of the jump.
        shift: (pulses, m, 3), see `SkiLines.shift`.
        spread: (pulses, m, 3), likewise; zero where they are left out.
    """
    cameras = tuple(system.cameras.values())
    found = [
        (p * len(SIDES) + SIDES.index(side), j, ski)
        for p, pulse in enumerate(pulses)
        for j, camera in enumerate(cameras)
        if camera.name in pulse.images
        for side, ski in pulse.images[camera.name].skis.items()
    ]
    n, m = len(pulses) * len(SIDES), len(cameras)
    k = max((len(ski.xy) for _, _, ski in found), default=2)
    xy, weight, common = np.zeros((n, m, k, 2)), np.zeros((n, m, k)), np.zeros((n, m))
    by_hand = np.zeros((n, m), bool)
    for i, j, ski in found:
        points = len(ski.xy)
        xy[i, j, :points], weight[i, j, :points], common[i, j] = ski.xy, ski.sigma**-2.0, ski.common
        xy[i, j, points:] = ski.xy[0]  # with weight 0, but where rays and lines meet
        by_hand[i, j] = ski.source is Source.BY_HAND
    arrays, _ = stacked(cameras, len(system.covariance))
    ray = arrays.in_turn(n, k).rays(xy.reshape(-1, 2)).reshape(n, m, k, 3)
    return SkiLines(
        cameras,
        len(system.covariance),
        xy,
        ray,
        weight,
        common,
        _long(xy, weight),
        by_hand,
        *of_objects((shift, spread), (len(pulses), m), len(SIDES)),
    )


def across_axes(direction: Floats) -> tuple[Floats, Floats]:
    """Two unit vectors (n, 3) at right angles to unit directions (n, 3) and to each other."""
    least = np.eye(3)[np.abs(direction).argmin(axis=1)]
    one = _unit(cross(direction, least))
    return one, cross(direction, one)


def _long(xy: Floats, weight: Floats) -> Flags:
    """Whether image lines (n, m, k) have a direction."""
    total = np.maximum(weight.sum(axis=-1), np.finfo(float).tiny)
    centre = (weight[..., None] * xy).sum(axis=-2) / total[..., None]
    away = (xy - centre[..., None, :]) * np.sqrt(weight)[..., None]
    along = np.linalg.eigvalsh(np.swapaxes(away, -1, -2) @ away)[..., -1]  # its inverse is the turn's variance
    return np.asarray(along * _LARGEST_IMAGE_TURN**2 > 1)


def _nearest_on_line(origin: Floats, direction: Floats, centre: Floats, ray: Floats) -> Floats:
    """Points (..., 3) of lines that are nearest to rays from centres."""
    offset = origin - centre
    cosine = (direction * ray).sum(axis=-1, keepdims=True)
    on_line, on_ray = (direction * offset).sum(axis=-1, keepdims=True), (ray * offset).sum(axis=-1, keepdims=True)
    return np.asarray(origin + direction * (cosine * on_ray - on_line) / (1 - cosine**2))


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector, axis=-1, keepdims=True))
