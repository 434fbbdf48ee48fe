"""The state of the jumper in each pulse from its points and skis: angles, height, speed, each with everything in sigma.

All that a pulse gives is put into one vector: P1 to P4 and the unit directions of right and left ski, 18 numbers. Its
covariance is that of the image measurement, where points and skis are independent, and of the calibration, which they
share. Every quantity takes its sigma from there, by its derivatives.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.measurements.model import POINTS, SIDES
from analysis.pulses.gross_errors import Checked
from analysis.pulses.skis import across_axes
from analysis.pulses.travel import speeds, way_ahead
from analysis.result.model import JumperState, PointState, Quantity, SkiState, Status
from analysis.scene.camera_system import CameraSystem
from photogrammetry.jumper.stick_model import ANGLES, body_angles, slope_and_heading
from rig.arrays import Flags, Floats, Integers

_STEP = 1e-6  # of numerical derivatives, m and rad: errors of 1e-9 of them
_CONTROLLED_BY = 3  # rays


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """Points and skis of k pulses.

    Attributes:
        points: 4 k of them, P1 to P4 pulse by pulse.
        points_by_hand: (4 k, m).
        skis: 2 k of them, right and left pulse by pulse.
        skis_by_hand: (2 k, m).
    """

    points: Checked
    points_by_hand: Flags
    skis: Checked
    skis_by_hand: Flags

    def coordinates(self) -> Floats:
        """P1 to P4 (k, 4, 3), NaN where not determined."""
        adjusted = self.points.adjusted
        return np.where(adjusted.ok[:, None], adjusted.state, np.nan).reshape(-1, len(POINTS), 3)


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """Everything that k pulses gave, as one vector each: P1 to P4, then unit directions of right and left ski.

    Attributes:
        values: (k, 18), NaN where not determined.
        own: (k, 18, 18) covariance from the image measurement alone.
        by_calibration: (k, 18, p) change by errors of the calibration.
        calibration: (p, p) covariance of the calibration.
    """

    values: Floats
    own: Floats
    by_calibration: Floats
    calibration: Floats

    @property
    def covariance(self) -> Floats:
        """(k, 18, 18) from everything."""
        return np.asarray(self.own + self.by_calibration @ self.calibration @ np.swapaxes(self.by_calibration, 1, 2))


def jumper_states(solved: Solved, pulses: Integers, times: Floats, system: CameraSystem) -> tuple[JumperState, ...]:
    """States of the jumper.

    Args:
        solved: points and skis of k pulses.
        pulses: (k,) numbers.
        times: (k,) s.
        system: the cameras that they were solved with.
    """
    joint = _joint(solved, times, system.covariance)
    covariance = joint.covariance
    angles = _with_sigma(_angles, joint.values, covariance)
    courses = [
        _with_sigma(slope_and_heading, joint.values[:, i : i + 3], covariance[:, i : i + 3, i : i + 3])
        for i in (12, 15)
    ]
    mean = np.zeros((3, 18))
    mean[:, 6:9] = mean[:, 9:12] = np.eye(3) / 2
    origin = joint.values[:, 6:12].reshape(-1, 2, 3).mean(axis=1)
    height = np.sqrt((mean @ covariance @ mean.T)[:, 2, 2])
    speed = speeds(origin, mean @ joint.own @ mean.T, mean @ joint.by_calibration, joint.calibration, pulses, times)
    states = []
    for k in range(len(pulses)):
        points = {
            name: _point(solved, k * len(POINTS) + i, covariance[k, 3 * i : 3 * i + 3, 3 * i : 3 * i + 3], system.names)
            for i, name in enumerate(POINTS)
        }
        skis = {
            side: _ski(solved, k * len(SIDES) + i, joint.values[k, 12 + 3 * i : 15 + 3 * i], course, k, system.names)
            for i, (side, course) in enumerate(zip(SIDES, courses, strict=True))
        }
        body = {name: _quantity(angles[0][k, i], angles[1][k, i, i]) for i, name in enumerate(ANGLES)}
        states.append(
            JumperState(points, skis, body, _number(origin[k, 2], height[k]), _number(speed[k, 0], speed[k, 1]))
        )
    return tuple(states)


def _joint(solved: Solved, times: Floats, calibration: Floats) -> Joint:
    k, p = len(times), len(calibration)
    points, skis = solved.points.adjusted, solved.skis.adjusted
    values, own = np.full((k, 18), np.nan), np.zeros((k, 18, 18))
    by_calibration = np.zeros((k, 18, p))
    coordinates = solved.coordinates()
    values[:, :12] = coordinates.reshape(k, 12)
    direction = skis.state[:, 3:]
    backwards = direction @ way_ahead(coordinates, times) < 0
    values[:, 12:] = np.where(skis.ok[:, None], np.where(backwards[:, None], -direction, direction), np.nan).reshape(
        k, 6
    )
    turns = np.stack(across_axes(direction), axis=2) * np.where(backwards, -1.0, 1.0)[:, None, None]
    for i in range(len(POINTS)):
        here, of = slice(3 * i, 3 * i + 3), slice(i, None, len(POINTS))
        own[:, here, here] = _where(points.ok[of], points.image_covariance[of])
        by_calibration[:, here] = _where(points.ok[of], points.by_calibration[of])
    for i in range(len(SIDES)):
        here, of = slice(12 + 3 * i, 15 + 3 * i), slice(i, None, len(SIDES))
        turn = turns[of]
        own[:, here, here] = _where(skis.ok[of], turn @ skis.image_covariance[of, 2:, 2:] @ np.swapaxes(turn, 1, 2))
        by_calibration[:, here] = _where(skis.ok[of], turn @ skis.by_calibration[of, 2:])
    return Joint(values, own, by_calibration, calibration)


def _where(ok: Flags, matrices: Floats) -> Floats:
    return np.where(ok[:, None, None], matrices, 0.0)


def _angles(values: Floats) -> Floats:
    """Angles (..., 5) of vectors (..., 18), rad."""
    helmet, hip, right, left, right_ski, left_ski = (values[..., i : i + 3] for i in range(0, 18, 3))
    return body_angles(helmet, hip, (right + left) / 2, right_ski, left_ski)


def _with_sigma(function: Callable[[Floats], Floats], values: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Values (k, q) of a function of vectors (k, s), and their covariance (k, q, q), by numerical derivatives."""
    steps = _STEP * np.eye(values.shape[1])
    with np.errstate(invalid="ignore"):
        there = function(values[:, None] + steps) - function(values[:, None] - steps)
        jacobian = np.nan_to_num(np.swapaxes(there, 1, 2) / (2 * _STEP))
        return function(values), jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)


def _point(solved: Solved, row: int, covariance: Floats, names: Sequence[str]) -> PointState | None:
    checked = solved.points
    if not checked.adjusted.ok[row]:
        return None
    cameras, status = _seen(checked.used[row], solved.points_by_hand[row], names)
    return PointState(checked.adjusted.state[row].copy(), covariance.copy(), cameras, status)


def _ski(
    solved: Solved, row: int, direction: Floats, course: tuple[Floats, Floats], k: int, names: Sequence[str]
) -> SkiState | None:
    checked = solved.skis
    if not checked.adjusted.ok[row]:
        return None
    cameras, status = _seen(checked.used[row], solved.skis_by_hand[row], names)
    slope, heading = (_quantity(course[0][k, i], course[1][k, i, i]) for i in range(2))
    if slope is None or heading is None:
        return None
    correlation = course[1][k, 0, 1] / np.sqrt(course[1][k, 0, 0] * course[1][k, 1, 1])
    return SkiState(direction.copy(), slope, heading, float(correlation), cameras, status)


def _seen(used: Flags, by_hand: Flags, names: Sequence[str]) -> tuple[tuple[str, ...], Status]:
    cameras = tuple(name for name, here in zip(names, used, strict=True) if here)
    if (used & by_hand).any():
        return cameras, Status.BY_HAND
    return cameras, Status.CONTROLLED if len(cameras) >= _CONTROLLED_BY else Status.TWO_RAYS


def _quantity(angle: float, variance: float) -> Quantity | None:
    """An angle in degrees from rad and rad^2."""
    return _number(np.degrees(angle), np.degrees(np.sqrt(variance)))


def _number(value: float, sigma: float) -> Quantity | None:
    return Quantity(float(value), float(sigma)) if np.isfinite(value) else None
