"""Aligns jumps at the take-off.

The take-off is when O passes the edge. Each jump's own motion tells that time to some milliseconds only, but the edge
is at the same place for all jumps of a hill, and the time at which O passes any place is known to a fraction of these.
So the places at which the jumps' take-offs lie are averaged, and every jump is aligned with that place. Then what is
uncertain in the edge shifts all jumps alike. Where the places contradict each other (another hill, another frame of the
survey), each jump keeps its own take-off.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import chdtri

from analysis.comparison.aligned import HEIGHT, VELOCITY, MeasuredJump
from analysis.comparison.shared_calibration import shared_calibration
from analysis.result.model import PulseState, SmoothedState
from rig.arrays import Floats

#: Probability that jumps over one edge are taken for jumps over several.
RISK: Final = 1e-4
_NEWTON_STEPS: Final = 4
#: Pulses either side of the take-off that show the variance of O; the least part of it that measurement has.
_AROUND: Final = 4
_LEAST_PART: Final = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """Aligned jumps.

    Attributes:
        jumps: in the order given.
        shared_sigma_s: standard deviation of the take-off that they have in common; 0 where each has its own.
        at_one_place: whether the take-offs of all are at one place.
    """

    jumps: list[MeasuredJump]
    shared_sigma_s: float
    at_one_place: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Path:
    """O on its way along a common direction, near the take-off that a jump itself says.

    Attributes:
        way: m, as a function of the time since that take-off.
        sigma_way: of the way, m.
        place: way at the take-off, m.
        speed: there, m/s.
        sigma_s: of the take-off.
    """

    way: CubicSpline
    sigma_way: float
    place: float
    speed: float
    sigma_s: float


def align(jumps: list[MeasuredJump]) -> Alignment:
    """Align jumps; at one place if there is one edge."""
    directions = [jump.smoothed()[_nearest(jump)][1].velocity.value for jump in jumps]
    along = np.sum([direction / np.linalg.norm(direction) for direction in directions], axis=0)
    along /= np.linalg.norm(along)
    shared = shared_calibration([jump.recording for jump in jumps])
    paths = [_path(jump, along, own) for jump, own in zip(jumps, shared.own, strict=True)]
    places = np.array([path.place for path in paths])
    weights = np.array([(path.speed * path.sigma_s) ** 2 + path.sigma_way**2 for path in paths]) ** -1.0
    edge = float(places @ weights / weights.sum())
    if float((places - edge) ** 2 @ weights) > chdtri(max(len(jumps) - 1, 1), RISK):
        return Alignment(jumps, 0.0, at_one_place=False)
    aligned = [
        replace(jump, shift_s=jump.shift_s + _time(path, edge), takeoff_sigma_s=path.sigma_way / path.speed)
        for jump, path in zip(jumps, paths, strict=True)
    ]
    speed = float(np.mean([path.speed for path in paths]))
    return Alignment(aligned, float(weights.sum() ** -0.5) / speed, at_one_place=True)


def _nearest(jump: MeasuredJump) -> int:
    return int(np.argmin(np.abs(jump.since_takeoff())))


def _path(jump: MeasuredJump, along: Floats, calibration: Floats) -> _Path:
    """The path of a jump; `calibration`: covariance of what it does not share with the others."""
    found = jump.smoothed()
    way = CubicSpline(jump.since_takeoff(), [state.origin.value @ along for _, state in found])
    covariance = found[_nearest(jump)][1].origin.covariance
    variance = float(along @ covariance @ along)
    part = _own_part(found[_nearest(jump)][1], calibration, jump.recording.orientation.covariance)
    if part < 1:
        around = found[max(_nearest(jump) - _AROUND, 0) : _nearest(jump) + _AROUND + 1]
        parts = [_of_measurement(*each, along, jump) for each in around]
        known = [part for part in parts if part is not None]
        if known:
            measured = min(max(float(np.median(known)), _LEAST_PART * variance), variance)
            variance = measured + part * (variance - measured)
    return _Path(way, math.sqrt(variance), float(way(0.0)), float(way(0.0, 1)), jump.takeoff_sigma_s)


def _own_part(state: SmoothedState, own: Floats, whole: Floats) -> float:
    """How much of the variance by calibration a jump does not share: as in its height, 1 if that is not known."""
    by = state.by_calibration[HEIGHT]
    if not np.isfinite(by).all() or not by @ whole @ by > 0:
        return 1.0
    return min(max(float(by @ own @ by) / float(by @ whole @ by), 0.0), 1.0)


def _of_measurement(pulse: PulseState, state: SmoothedState, along: Floats, jump: MeasuredJump) -> float | None:
    """Variance of O along the path by errors of measurement; None where it does not show.

    The bindings' raw positions have variances c + n, and O, the mean of both, c + s n / 2 after smoothing: c of the
    calibration, n of the measurement, s the share that smoothing leaves. That share follows from the variance of the
    velocity, of which the share of the calibration is known: a smoother that lets frequencies up to w pass (see
    `repeatability`, w in rad per pulse) leaves s = w / 3 of the variance of places, and w^3 / 6 for the velocity.
    """
    right, left = pulse.raw.points.get("P3"), pulse.raw.points.get("P4")
    by = along @ state.by_calibration[VELOCITY]
    if right is None or left is None or not np.isfinite(by).all():
        return None
    apart = float(along @ (right.covariance + left.covariance) @ along) / 2
    raw = (apart - float(along @ state.origin.covariance @ along)) / 2
    rate = float(along @ state.velocity.covariance @ along - by @ jump.recording.orientation.covariance @ by)
    if not (raw > 0 and rate > 0):
        return None
    share = min(float(np.cbrt(6 * rate / (raw * jump.recording.rate_hz**2))) / 3, 1.0)
    return share * raw / (1 - share / 2)


def _time(path: _Path, edge: float) -> float:
    """When O passes the edge, s since the take-off that the jump itself says."""
    time = 0.0
    for _ in range(_NEWTON_STEPS):
        time -= (float(path.way(time)) - edge) / float(path.way(time, 1))
    return time
