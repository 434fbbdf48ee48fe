"""Points of the jumper in space: rays of all pulses, their start values and their equations."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.measurements.model import POINTS, PulseMeasurements, Source
from analysis.pulses.least_squares import Equations
from analysis.scene.camera_arrays import stacked
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from rig.arrays import Flags, Floats, Integers


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """n points in m images: state (n, 3) coordinates; local parameters their increments.

    Attributes:
        cameras: the m cameras.
        parameters: number p of their uncertain parameters.
        xy: (n, m, 2) px; anything where not seen.
        covariance: (n, m, 2, 2) px^2.
        seen: (n, m).
        by_hand: (n, m).
        shift: (n, m, 3) how much farther the jumper was when the camera saw it than at the instant of the result, m.
        spread: (n, m, 3) standard deviation of the shift, along the way, m.
    """

    cameras: Sequence[PlacedCamera]
    parameters: int
    xy: Floats
    covariance: Floats
    seen: Flags
    by_hand: Flags
    shift: Floats
    spread: Floats

    def start(self, seen: Flags) -> Floats:
        """The points (n, 3) with the least square sum of distances from the rays."""
        n, m = seen.shape
        cameras, _ = stacked(tuple(self.cameras), self.parameters)
        ray = cameras.in_turn(n).rays(self.xy.reshape(-1, 2)).reshape(n, m, 3)
        centroid = cameras.position.mean(axis=0)
        projector = np.eye(3) - ray[..., :, None] * ray[..., None, :]
        projector = np.where((seen & np.isfinite(ray).all(axis=2))[..., None, None], projector, 0.0)
        target = (projector @ (cameras.position - centroid - self.shift)[..., None]).sum(axis=1)
        return np.asarray((np.linalg.pinv(projector.sum(axis=1)) @ target)[..., 0] + centroid)

    def equations(self, state: Floats) -> Equations:
        """Collinearity equations (A1)."""
        n, m = self.seen.shape
        cameras, own = stacked(tuple(self.cameras), self.parameters)
        places = (state[:, None] + self.shift).reshape(-1, 3)
        v, by_point, by_own, before = cameras.in_turn(n).equations(places, self.xy.reshape(-1, 2))
        by_point = by_point.reshape(n, m, 2, 3)
        off = by_point @ self.spread[..., None]
        return Equations(
            v.reshape(n, m, 2),
            by_point,
            by_own.reshape(n, m, 2, by_own.shape[-1]) @ own,
            self.covariance + off * off.swapaxes(2, 3),
            before.reshape(n, m),
        )

    def moved(self, state: Floats, step: Floats) -> Floats:
        """Points (n, 3) moved by steps (n, 3)."""
        return np.asarray(state + step)

    def reach(self, state: Floats) -> Floats:
        """The distance from the nearest camera."""
        return np.repeat(nearest(self.cameras, state, self.seen)[:, None], 3, axis=1)

    def scaled(self, factor: float) -> "Points":
        """The same with all standard deviations of the image measurement times a factor."""
        return replace(self, covariance=self.covariance * factor**2)

    def sigma(self) -> float:
        """Median standard deviation of the image measurement, px."""
        variance = np.trace(self.covariance[self.seen], axis1=1, axis2=2) / 2
        return float(np.sqrt(np.median(variance))) if len(variance) else 0.0

    def subset(self, rows: Integers) -> "Points":
        """The points `rows`, which may repeat."""
        return replace(
            self,
            xy=self.xy[rows],
            covariance=self.covariance[rows],
            seen=self.seen[rows],
            by_hand=self.by_hand[rows],
            shift=self.shift[rows],
            spread=self.spread[rows],
        )


def points_of(
    system: CameraSystem, pulses: Sequence[PulseMeasurements], shift: Floats | None = None, spread: Floats | None = None
) -> Points:
    """All points of a jump: P1 to P4 of the first pulse, then of the next.

    Args:
        system: m oriented cameras; measurements of others are left out.
        pulses: of the jump.
        shift: (pulses, m, 3), see `Points.shift`.
        spread: (pulses, m, 3), likewise; zero where they are left out.
    """
    cameras = tuple(system.cameras.values())
    n, m = len(pulses) * len(POINTS), len(cameras)
    xy, covariance = np.zeros((n, m, 2)), np.tile(np.eye(2), (n, m, 1, 1))
    seen, by_hand = np.zeros((n, m), bool), np.zeros((n, m), bool)
    for p, pulse in enumerate(pulses):
        for j, camera in enumerate(cameras):
            if camera.name not in pulse.images:
                continue
            for name, point in pulse.images[camera.name].points.items():
                i = p * len(POINTS) + POINTS.index(name)
                xy[i, j], covariance[i, j], seen[i, j] = point.xy, point.covariance, True
                by_hand[i, j] = point.source is Source.BY_HAND
    ways = of_objects((shift, spread), (len(pulses), m), len(POINTS))
    return Points(cameras, len(system.covariance), xy, covariance, seen, by_hand, *ways)


def of_objects(ways: Iterable[Floats | None], size: tuple[int, int], objects: int) -> Iterator[Floats]:
    """Ways (pulses objects, m, 3) of all objects, from the ways (pulses, m, 3) shared by the objects of a pulse.

    Args:
        ways: of a pulse and a camera; None: nobody moves.
        size: numbers of pulses and cameras.
        objects: number of objects in a pulse.
    """
    for way in ways:
        yield np.repeat(np.zeros((*size, 3)) if way is None else way, objects, axis=0)


def rays(camera: PlacedCamera, xy: Floats) -> Floats:
    """Unit vectors (..., 3) in the object system from the camera to what appears at xy (..., 2), px."""
    reduced = camera.reduced(xy)
    towards = np.concatenate((reduced, np.full((*reduced.shape[:-1], 1), -camera.camera.interior[0])), axis=-1)
    return np.asarray((towards / np.linalg.norm(towards, axis=-1, keepdims=True)) @ camera.rotation.T)


def nearest(cameras: Sequence[PlacedCamera], points: Floats, seen: Flags) -> Floats:
    """Distances (n,) of points (n, 3) from the nearest camera that saw them; infinite where none did."""
    away = np.linalg.norm(points[:, None] - np.array([camera.position for camera in cameras]), axis=2)
    return np.asarray(np.where(seen, away, np.inf).min(axis=1))
