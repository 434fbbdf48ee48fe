"""Measured jumps as series over common times since the take-off.

Smoothed values are interpolated by cubic splines; their variances, and the derivatives by the calibration, linearly.
How jumps are aligned: `analysis.comparison.alignment`.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.interpolate import CubicSpline

from analysis.result.model import QUANTITIES, Jump, JumperState, MeasuredRecording, PulseState, Quantity, SmoothedState
from rig.arrays import Floats
from rig.errors import BadInputError

#: Differences closer together than this tell nothing new; it bounds the number of times at high rates.
LEAST_STEP_S: Final = 0.02
_LEAST_TIMES: Final = 5
#: Rows of quantities.
HEIGHT: Final = QUANTITIES.index("height")
PHI: Final = QUANTITIES.index("phi")
ATTACK: Final = QUANTITIES.index("angle_of_attack")
_SPEED: Final = QUANTITIES.index("speed")
VELOCITY: Final = slice(QUANTITIES.index("velocity_x"), QUANTITIES.index("velocity_z") + 1)
#: Quantities that are derivatives by time of what is measured.
RATES: Final = np.array([name == "speed" or name.startswith("velocity") for name in QUANTITIES])
#: Of the raw variance; keeps the model of the smoother in its range.
_SHARES: Final = (0.002, 0.98)


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredJump:
    """A jump that can be compared: it has a take-off and smoothed values.

    Attributes:
        name: for people.
        recording: that it belongs to.
        jump: the jump.
        shift_s: by which its take-off is later than the jump itself says.
        takeoff_sigma_s: standard deviation of its take-off, without what it shares with the jumps it is aligned with.
    """

    name: str
    recording: MeasuredRecording
    jump: Jump
    shift_s: float
    takeoff_sigma_s: float

    @property
    def athlete(self) -> str:
        """Who jumped, as far as the recording says it."""
        return self.recording.session.get("athlete", "")

    def since_takeoff(self) -> Floats:
        """Times of the pulses with smoothed values, s."""
        return np.array([pulse.since_takeoff_s for pulse, _ in self.smoothed()]) - self.shift_s

    def smoothed(self) -> list[tuple[PulseState, SmoothedState]]:
        """The pulses with smoothed values."""
        return _smoothed(self.jump)


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """`QUANTITIES` of a jump at T times since the take-off; NaN where there are none.

    Attributes:
        times: (T,) s.
        values: (11, T) degrees, m, m/s.
        change: (11, T) of the values, per second.
        variance: (11, T) without the share of the calibration.
        by_calibration: (11, T, p) derivatives by the cameras' parameters.
        share: (11, T) variance of the smoothed value / that of the raw one, both without calibration: says how far in
            time the smoother reaches. For rates it is that of the height.
        correlation: (12, 12) of errors of measurement of different quantities at one time, as far as it is known; the
            last one is the slope of the path, which the angle of attack holds beside phi.
        takeoff_sigma_s: standard deviation of the take-off; see `MeasuredJump`.
        rate_hz: pulses per second.
        ends_s: first and last time that the smoother knew.
    """

    times: Floats
    values: Floats
    change: Floats
    variance: Floats
    by_calibration: Floats
    share: Floats
    correlation: Floats
    takeoff_sigma_s: float
    rate_hz: float
    ends_s: tuple[float, float]


def measured_jump(recording: MeasuredRecording, number: int, name: str) -> MeasuredJump:
    """One jump of a recording.

    Raises:
        BadInputError: there is none of this number, or it cannot be compared.
    """
    for jump in recording.jumps:
        if jump.number == number:
            if not comparable(jump) or jump.takeoff is None:
                raise BadInputError(
                    f"{name}: jump {number} has no take-off or no smoothed values, so it cannot be aligned; choose "
                    "another jump, or see its report for what was missing"
                )
            return MeasuredJump(name, recording, jump, 0.0, jump.takeoff.sigma_pulses / recording.rate_hz)
    numbers = ", ".join(str(jump.number) for jump in recording.jumps) or "none"
    raise BadInputError(f"{name}: has no jump {number} (it has {numbers}); choose one of them")


def comparable(jump: Jump) -> bool:
    """Whether a jump has a take-off and smoothed values."""
    return jump.takeoff is not None and len(_smoothed(jump)) >= _LEAST_TIMES


def common_times(jumps: list[MeasuredJump]) -> Floats:
    """Times (T,) since the take-off at which all of the jumps are measured; zero is one of the grid.

    Raises:
        BadInputError: there are too few.
    """
    seen = [jump.since_takeoff() for jump in jumps]
    rate = min(jump.recording.rate_hz for jump in jumps)
    step = max(LEAST_STEP_S, 1 / rate)
    first = int(np.ceil(max(times.min() for times in seen) / step))
    last = int(np.floor(min(times.max() for times in seen) / step))
    if last - first + 1 < _LEAST_TIMES:
        raise BadInputError(
            "the jumps are not measured at the same times since the take-off; compare jumps of one hill"
        )
    return step * np.arange(first, last + 1, dtype=float)


def series(jump: MeasuredJump, times: Floats) -> Series:
    """A jump at times since the take-off."""
    found = jump.smoothed()
    at = jump.since_takeoff()
    covariance = jump.recording.orientation.covariance
    by_calibration = np.stack([state.by_calibration for _, state in found], axis=1)
    values, sigmas = (np.array(x) for x in zip(*(_numbers(state) for _, state in found), strict=True))
    shared = np.einsum("ktp,pq,ktq->kt", by_calibration, covariance, by_calibration)
    variance = sigmas.T**2 - shared
    raw = np.stack([_raw_variances(pulse) for pulse, _ in found], axis=1) - shared
    return Series(
        times,
        *_splines(at, values.T, times),
        _linear(at, np.maximum(variance, _SHARES[0] * sigmas.T**2), times),
        np.stack([_linear(at, column, times) for column in np.moveaxis(by_calibration, -1, 0)], axis=-1),
        _linear(at, _share(variance, raw), times),
        _correlation([state for _, state in found]),
        jump.takeoff_sigma_s,
        jump.recording.rate_hz,
        (float(at[0]), float(at[-1])),
    )


def _smoothed(jump: Jump) -> list[tuple[PulseState, SmoothedState]]:
    return [
        (pulse, pulse.smoothed)
        for pulse in jump.pulses
        if pulse.smoothed is not None and np.isfinite(pulse.since_takeoff_s)
    ]


def _numbers(state: SmoothedState) -> tuple[Floats, Floats]:
    """Values and standard deviations (11,)."""
    velocity = zip(state.velocity.value, np.sqrt(np.diagonal(state.velocity.covariance)), strict=True)
    found = [
        *_angles(state),
        state.angle_of_attack,
        state.height,
        state.speed,
        *(Quantity(float(value), float(sigma)) for value, sigma in velocity),
    ]
    pairs = [(np.nan, np.nan) if each is None else (each.value, each.sigma) for each in found]
    return np.array([value for value, _ in pairs]), np.array([sigma for _, sigma in pairs])


def _angles(state: JumperState) -> list[Quantity | None]:
    return [state.angles.get(name) for name in QUANTITIES[:ATTACK]]


def _raw_variances(pulse: PulseState) -> Floats:
    """(11,) of the raw solution; NaN where it has none, and for quantities that it does not have."""
    found = np.full(len(QUANTITIES), np.nan)
    for row, each in enumerate([*_angles(pulse.raw), None, pulse.raw.height]):
        found[row] = np.nan if each is None else each.sigma**2
    return found


def _share(variance: Floats, raw: Floats) -> Floats:
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip(variance / raw, *_SHARES)
    share[ATTACK] = share[PHI]
    share[RATES] = share[HEIGHT]
    return np.stack([_filled(row) for row in share])


def _filled(row: Floats) -> Floats:
    """The row with gaps filled by interpolation; a half where nothing is known."""
    known = np.isfinite(row)
    index = np.arange(len(row))
    return np.interp(index, index[known], row[known]) if known.any() else np.full(len(row), 0.5)


def _correlation(states: list[SmoothedState]) -> Floats:
    """Speed and slope of the path are functions of the velocity; of the other quantities nothing is known."""
    whole = np.eye(len(QUANTITIES) + 1)
    covariance = np.mean([state.velocity.covariance for state in states], axis=0)
    along = np.mean([state.velocity.value for state in states], axis=0)
    along /= np.linalg.norm(along)
    upwards = np.array((0.0, 0.0, 1.0)) - along[2] * along  # direction in which the slope grows
    parts = np.vstack((along, np.eye(3), upwards))
    block = parts @ covariance @ parts.T
    rows = np.r_[_SPEED : VELOCITY.stop, len(QUANTITIES)]
    whole[np.ix_(rows, rows)] = block / np.sqrt(np.outer(block.diagonal(), block.diagonal()))
    return whole


def _splines(at: Floats, values: Floats, times: Floats) -> tuple[Floats, Floats]:
    """Values and their changes (k, T); NaN outside of what is known."""
    found = np.full((2, len(values), len(times)), np.nan)
    for row, line in enumerate(values):
        known = np.isfinite(line)
        if known.sum() >= _LEAST_TIMES:
            inside = (times >= at[known][0]) & (times <= at[known][-1])
            spline = CubicSpline(at[known], line[known])
            found[:, row, inside] = spline(times[inside]), spline(times[inside], 1)
    return found[0], found[1]


def _linear(at: Floats, values: Floats, times: Floats) -> Floats:
    """(k, T) of (k, n); NaN where all neighbours are."""
    rows = []
    for line in values:
        known = np.isfinite(line)
        rows.append(np.interp(times, at[known], line[known]) if known.any() else np.full(len(times), np.nan))
    return np.stack(rows)
