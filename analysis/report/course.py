"""A jump as functions of time and of the distance from the take-off: what figures, charts and stick models read."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from analysis.result.model import Jump, JumperState, PulseState, Quantity, SmoothedState
from photogrammetry.jumper.stick_model import ANGLES
from rig.arrays import Flags, Floats

#: Quantities of a course.
NAMES = (*ANGLES, "angle_of_attack", "height", "speed")
#: Points with a larger sigma are shown in grey, m: the accuracy that the method was designed for (Table 2).
LARGEST_SIGMA_M = 0.02
#: Between pulses that lie further apart than this many periods nothing is interpolated.
_GAP_PERIODS = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A quantity at all pulses: (n,) values and standard deviations, NaN where there is none."""

    value: Floats
    sigma: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A jump over time and distance.

    Attributes:
        pulses: of the jump, n of them.
        since: (n,) s after the take-off; after the first pulse where the take-off was not in sight.
        distance: (n,) m, horizontal, along the flight, from O at the take-off (or at the first pulse). NaN where O is
            not known.
        start: (3,) where the distance counts from.
        axes: (3, 3), rows: horizontal along the flight, horizontal to the left of it, up.
        smoothed: by name of `NAMES`, from the model over time.
        raw: likewise, of each pulse alone; the angle of attack is NaN.
        point_sigma: (n,) m, the largest sigma of a coordinate of P1 to P4, smoothed.
        takeoff_sigma_s: standard deviation of the time of take-off; None where it was not in sight.
    """

    pulses: tuple[PulseState, ...]
    since: Floats
    distance: Floats
    start: Floats
    axes: Floats
    smoothed: Mapping[str, Series]
    raw: Mapping[str, Series]
    point_sigma: Floats
    takeoff_sigma_s: float | None

    @property
    def unsure(self) -> Flags:
        """(n,) whether a point's sigma exceeds `LARGEST_SIGMA_M`."""
        return np.asarray(~(self.point_sigma <= LARGEST_SIGMA_M))

    def at_time(self, name: str, since_s: float) -> Quantity | None:
        """A smoothed quantity at a time after the take-off; None where it is not known, or the take-off is not."""
        if self.takeoff_sigma_s is None:
            return None
        return self._between(name, self.since, since_s, self.takeoff_sigma_s)

    def at_distance(self, name: str, distance: float) -> Quantity | None:
        """A smoothed quantity at a distance from the take-off, m; None where it is not known."""
        if self.takeoff_sigma_s is None:
            return None
        finite = np.flatnonzero(np.isfinite(self.distance))
        if len(finite) < 2:
            return None
        rate = np.ptp(self.distance[finite]) / np.ptp(self.since[finite])
        return self._between(name, self.distance, distance, self.takeoff_sigma_s * float(rate))

    def _between(self, name: str, places: Floats, place: float, sigma_place: float) -> Quantity | None:
        """Linear between neighbouring pulses.

        Values of neighbours are almost fully correlated: the sigma is interpolated as well, never reduced. What the
        place itself is uncertain by is added with the slope.
        """
        series = self.smoothed[name]
        with np.errstate(invalid="ignore"):
            at = int(np.count_nonzero(places <= place)) - 1
        if at == len(places) - 1 and len(places) > 1 and places[at] == place:
            at -= 1
        if not 0 <= at < len(places) - 1:
            return None
        step = float(places[at + 1] - places[at])
        ends, sigmas = series.value[at : at + 2], series.sigma[at : at + 2]
        apart = float(self.since[at + 1] - self.since[at])
        if not (np.isfinite([*ends, *sigmas, step]).all() and step > 0 and apart <= _GAP_PERIODS * self._period()):
            return None
        share = (place - float(places[at])) / step
        value, sigma = ((1 - share) * pair[0] + share * pair[1] for pair in (ends, sigmas))
        slope = float(ends[1] - ends[0]) / step
        return Quantity(float(value), float(np.hypot(sigma, slope * sigma_place)))

    def _period(self) -> float:
        return float(np.median(np.diff(self.since)))


def course_of(jump: Jump, rate_hz: float) -> Course:
    """The course of a jump.

    Args:
        jump: the jump.
        rate_hz: pulses per second.
    """
    pulses = jump.pulses
    since = np.array([pulse.since_takeoff_s for pulse in pulses])
    if jump.takeoff is None and pulses:
        since = np.array([(pulse.pulse - pulses[0].pulse) / rate_hz for pulse in pulses])
    origins = np.array([_origin(pulse) for pulse in pulses]).reshape(-1, 3)
    known = np.flatnonzero(np.isfinite(origins).all(axis=1))
    start, axes = _frame(since[known], origins[known])
    return Course(
        pulses,
        since,
        (origins - start) @ axes[0],
        start,
        axes,
        {name: _series([_quantity(pulse.smoothed, name) for pulse in pulses]) for name in NAMES},
        {name: _series([_quantity(pulse.raw, name) for pulse in pulses]) for name in NAMES},
        np.array([_largest_sigma(pulse.smoothed) for pulse in pulses]),
        None if jump.takeoff is None else jump.takeoff.sigma_pulses / rate_hz,
    )


def best_state(pulse: PulseState) -> JumperState:
    """What to draw of a pulse: the smoothed jumper, else that of the pulse alone."""
    return pulse.raw if pulse.smoothed is None else pulse.smoothed


def origin_of(state: JumperState) -> Floats | None:
    """O (3,), the middle between P3 and P4; None where one of them was not measured."""
    right, left = state.points.get("P3"), state.points.get("P4")
    return None if right is None or left is None else np.asarray((right.xyz + left.xyz) / 2)


def _origin(pulse: PulseState) -> Floats:
    origin = pulse.smoothed.origin.value if pulse.smoothed is not None else origin_of(pulse.raw)
    return np.full(3, np.nan) if origin is None else origin


def _frame(since: Floats, origins: Floats) -> tuple[Floats, Floats]:
    """Start and axes from where O was (n, 3); the flight is straight enough that its ends show its direction."""
    if not len(origins):
        return np.zeros(3), np.eye(3)
    at = min(max(0.0, float(since[0])), float(since[-1]))
    start = np.array([np.interp(at, since, origins[:, axis]) for axis in range(3)])
    along = (origins[-1] - origins[0]) * (1.0, 1.0, 0.0)
    length = float(np.linalg.norm(along))
    along = along / length if length > 0 else np.array((1.0, 0.0, 0.0))
    up = np.array((0.0, 0.0, 1.0))
    return start, np.stack((along, np.cross(up, along), up))


def _quantity(state: JumperState | None, name: str) -> Quantity | None:
    if state is None:
        return None
    if name in ANGLES:
        return state.angles.get(name)
    if name == "angle_of_attack":
        return state.angle_of_attack if isinstance(state, SmoothedState) else None
    return state.height if name == "height" else state.speed


def _series(quantities: list[Quantity | None]) -> Series:
    pairs = [(np.nan, np.nan) if q is None else (q.value, q.sigma) for q in quantities]
    return Series(*np.array(pairs).reshape(-1, 2).T)


def _largest_sigma(state: SmoothedState | None) -> float:
    covariances = [] if state is None else [point.covariance for point in state.points.values() if point is not None]
    return max((float(np.sqrt(np.diagonal(c).max())) for c in covariances), default=np.nan)
