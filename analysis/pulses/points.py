"""Points of the jumper in space: rays of all pulses, their start values and their equations."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.measurements.model import POINTS, PulseMeasurements, Source
from analysis.pulses.least_squares import Equations
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
    """

    cameras: Sequence[PlacedCamera]
    parameters: int
    xy: Floats
    covariance: Floats
    seen: Flags
    by_hand: Flags
    shift: Floats

    def start(self, seen: Flags) -> Floats:
        """The points (n, 3) with the least square sum of distances from the rays."""
        across, target = np.zeros((len(seen), 3, 3)), np.zeros((len(seen), 3))
        centroid = np.mean([camera.position for camera in self.cameras], axis=0)
        for image, camera in enumerate(self.cameras):
            ray = rays(camera, self.xy[:, image])
            projector = np.eye(3) - ray[:, :, None] * ray[:, None, :]
            projector = np.where(seen[:, image, None, None] & np.isfinite(projector), projector, 0.0)
            across += projector
            target += np.einsum("nij,nj->ni", projector, camera.position - centroid - self.shift[:, image])
        return np.asarray(np.einsum("nij,nj->ni", np.linalg.pinv(across), target) + centroid)

    def equations(self, state: Floats) -> Equations:
        """Collinearity equations (A1)."""
        parts = [camera.linearised(state + self.shift[:, i], self.xy[:, i]) for i, camera in enumerate(self.cameras)]
        n, m = self.seen.shape
        by_calibration = np.zeros((n, m, 2, self.parameters))
        for image, (camera, part) in enumerate(zip(self.cameras, parts, strict=True)):
            by_calibration[:, image, :, camera.columns] = np.moveaxis(part[2], -1, 0)
        return Equations(
            np.stack([part[0] for part in parts], axis=1),
            np.stack([part[1] for part in parts], axis=1),
            by_calibration,
            self.covariance,
            np.stack([camera.in_front(state) for camera in self.cameras], axis=1),
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
        )


def points_of(system: CameraSystem, pulses: Sequence[PulseMeasurements], shift: Floats) -> Points:
    """All points of a jump: P1 to P4 of the first pulse, then of the next.

    Args:
        system: m oriented cameras; measurements of others are left out.
        pulses: of the jump.
        shift: (pulses, m, 3), see `Points.shift`.
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
    return Points(cameras, len(system.covariance), xy, covariance, seen, by_hand, np.repeat(shift, len(POINTS), axis=0))


def rays(camera: PlacedCamera, xy: Floats) -> Floats:
    """Unit vectors (..., 3) in the object system from the camera to what appears at xy (..., 2), px."""
    reduced = camera.reduced(xy)
    towards = np.concatenate((reduced, np.full((*reduced.shape[:-1], 1), -camera.camera.interior[0])), axis=-1)
    return np.asarray((towards / np.linalg.norm(towards, axis=-1, keepdims=True)) @ camera.rotation.T)


def nearest(cameras: Sequence[PlacedCamera], points: Floats, seen: Flags) -> Floats:
    """Distances (n,) of points (n, 3) from the nearest camera that saw them; infinite where none did."""
    away = np.stack([np.linalg.norm(points - camera.position, axis=1) for camera in cameras], axis=1)
    return np.asarray(np.where(seen, away, np.inf).min(axis=1))
