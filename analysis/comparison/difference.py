"""The difference of two jumps over the time since the take-off, with what of it is real.

The covariance of the difference has three parts: errors of measurement of both jumps; errors of the calibration, which
mostly cancel as far as both jumps share them; and errors of the take-off, which shift jumps in time. The greatest
of many differences is judged as the greatest of many: the distribution of the largest test value is simulated from
the correlations, and expressed by the number of independent differences that has the same 5 % limit.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtr

from analysis.comparison.aligned import HEIGHT, Series, common_times, series
from analysis.comparison.alignment import Alignment
from analysis.comparison.repeatability import noise_covariance
from analysis.comparison.shared_calibration import Common, SharedCalibration, shared_calibration
from analysis.result.model import EDGE_S, QUANTITIES
from rig.arrays import Flags, Floats

#: Probability of finding a difference somewhere where there is none.
LEVEL: Final = 0.05
#: With so many draws the probability of an alarm is known to 0.3 %.
DRAWS: Final = 4_000
_SEED: Final = 2012
#: Changes, lasting over the flight, whose chance of being found is stated: degrees, m, m/s.
CHANGES: Final = dict(zip(QUANTITIES, (2.0, 2.0, 2.0, 1.0, 1.0, 1.0, 0.02, 0.2, 0.2, 0.2, 0.2), strict=True))
FOUND: Final = 0.8  #: probability with which `Power.change_80` is found
_BISECTIONS: Final = 30


@dataclass(frozen=True, slots=True)
class Power:
    """What would have been found in a quantity.

    Attributes:
        change: a change that lasts over the flight, degrees, m, m/s.
        probability: with which it would have been found.
        change_80: the change that would have been found with a probability of 80 %.
    """

    change: float
    probability: float
    change_80: float


@dataclass(frozen=True, slots=True, eq=False)
class Difference:
    """B minus A at T times since the take-off; NaN where a quantity is not known.

    Attributes:
        times: (T,) s.
        a: (11, T) the one jump; degrees, m, m/s.
        b: (11, T) the other.
        sigma: (11, T) standard deviation of the difference.
        repeat: (11, T) standard deviation of the difference of two measurements of one jump: what tests judge by.
        p: (11, T) probability of such a difference at one time in jumps that are equal.
        p_greatest: (11, T) probability that the greatest of all differences is as large, in jumps that are equal.
        independent: how many independent differences have the same 5 % limit.
        limit: the limit of |b - a| / repeat.
        common: whose errors cancel.
        power: by quantity; None where it is not known in flight.
    """

    times: Floats
    a: Floats
    b: Floats
    sigma: Floats
    repeat: Floats
    p: Floats
    p_greatest: Floats
    independent: float
    limit: float
    common: Common
    power: dict[str, Power | None]

    @property
    def value(self) -> Floats:
        """(11, T) B minus A."""
        return self.b - self.a

    def greatest(self, quantity: int) -> int | None:
        """Index of the time at which a quantity differs most, in units of what is expected; None if it is unknown."""
        z = np.abs(self.value[quantity]) / self.repeat[quantity]
        return None if np.isnan(z).all() else int(np.nanargmax(z))

    def found(self) -> list[str]:
        """Quantities that differ."""
        best = [(name, self.greatest(row)) for row, name in enumerate(QUANTITIES)]
        return [name for name, at in best if at is not None and self._differs(name, at)]

    def _differs(self, name: str, at: int) -> bool:
        return bool(self.p_greatest[QUANTITIES.index(name), at] < LEVEL)


def difference(alignment: Alignment, draws: int = DRAWS) -> Difference:
    """Compare two jumps.

    Args:
        alignment: the first two of its jumps are compared.
        draws: of the distribution of the greatest difference.

    Raises:
        BadInputError: they are not measured at the same times since the take-off.
    """
    a, b = alignment.jumps[:2]
    times = common_times([a, b])
    one, other = series(a, times), series(b, times)
    calibration = shared_calibration([a.recording, b.recording])
    shared = shared_covariance(one, other, calibration, alignment.shared_sigma_s)
    noise = noise_covariance(one) + noise_covariance(other)
    known = np.isfinite(one.values + other.values).ravel()
    covariance = (shared + noise)[np.ix_(known, known)]
    deviation = np.sqrt(covariance.diagonal())
    extremes = _draws(covariance / np.outer(deviation, deviation), draws)
    limit = float(np.quantile(np.abs(extremes).max(axis=1), 1 - LEVEL))
    independent = float(np.log1p(-LEVEL) / np.log1p(-2 * ndtr(-limit)))
    repeat = _spread(deviation, known, one.values.shape)
    p = 2 * ndtr(-np.abs(other.values - one.values) / repeat)
    stated = one.variance + other.variance + shared.diagonal().reshape(one.values.shape)
    return Difference(
        times,
        one.values,
        other.values,
        np.sqrt(stated),
        repeat,
        p,
        as_greatest(p, independent),
        independent,
        limit,
        calibration.common,
        _power(extremes, deviation, known, times, limit),
    )


def as_greatest(p: Floats, independent: float) -> Floats:
    """Probability that the greatest of so many independent differences is as large as one of probability p."""
    return np.asarray(-np.expm1(independent * np.log1p(-np.minimum(p, 1 - 1e-12))))


def shared_covariance(one: Series, other: Series, calibration: SharedCalibration, shared_sigma_s: float) -> Floats:
    """Covariance (11 T, 11 T) of the difference by calibration and take-off; `calibration` has one `own` for each."""
    return _calibration(one, other, calibration) + _takeoff(one, other, shared_sigma_s)


def _calibration(one: Series, other: Series, calibration: SharedCalibration) -> Floats:
    """The share (11 T, 11 T) of the calibration."""
    ja, jb = (np.nan_to_num(x.by_calibration.reshape(x.values.size, -1)) for x in (one, other))
    own = ja @ calibration.own[0] @ ja.T + jb @ calibration.own[1] @ jb.T
    if calibration.shared is None:
        return np.asarray(own)
    return np.asarray(own + (jb - ja) @ calibration.shared @ (jb - ja).T)


def _takeoff(one: Series, other: Series, shared_sigma_s: float) -> Floats:
    """The share (11 T, 11 T) of the take-off: a jump that seems late is compared with an earlier part of the other.

    The place where a jump is aligned and its height err together, because each jump improves the calibration a little
    on its own; how much is not known, so the height gets the most that it can be.
    """
    shifts = [
        one.change * one.takeoff_sigma_s,
        other.change * other.takeoff_sigma_s,
        (other.change - one.change) * shared_sigma_s,
    ]
    for jump, shift in zip((one, other), list(shifts), strict=False):
        together = np.zeros_like(shift)
        together[HEIGHT] = np.sqrt(2 * np.abs(shift[HEIGHT]) * np.sqrt(jump.variance[HEIGHT]))
        shifts.append(together)
    return np.asarray(sum(np.outer(shift, shift) for shift in (np.nan_to_num(each.ravel()) for each in shifts)))


def _draws(correlation: Floats, draws: int) -> Floats:
    """Draws (draws, m) of the test values of jumps that are equal."""
    values, vectors = np.linalg.eigh(correlation)
    kept = values > 1e-9 * values[-1]
    factor = vectors[:, kept] * np.sqrt(values[kept])
    return np.asarray(np.random.default_rng(_SEED).standard_normal((draws, int(kept.sum()))) @ factor.T)


def _spread(values: Floats, known: Flags, shape: tuple[int, ...]) -> Floats:
    whole = np.full(known.shape, np.nan)
    whole[known] = values
    return whole.reshape(shape)


def _power(draws: Floats, deviation: Floats, known: Flags, times: Floats, limit: float) -> dict[str, Power | None]:
    column = np.cumsum(known) - 1
    flight = known & np.tile(times > EDGE_S, len(QUANTITIES))
    found: dict[str, Power | None] = {}
    for row, name in enumerate(QUANTITIES):
        of_quantity = np.arange(len(known)) // len(times) == row
        columns = column[flight & of_quantity]
        if len(columns) == 0:
            found[name] = None
            continue
        z, unit = draws[:, columns], 1 / deviation[columns]
        low, high = 0.0, float(4 * limit / unit.max())
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            low, high = (low, middle) if _chance(z, unit, middle, limit) > FOUND else (middle, high)
        found[name] = Power(CHANGES[name], _chance(z, unit, CHANGES[name], limit), high)
    return found


def _chance(z: Floats, unit: Floats, change: float, limit: float) -> float:
    """With which a change is found, given draws (draws, m) of test values and the test value (m,) of a unit change."""
    return float((np.abs(z + change * unit).max(axis=1) > limit).mean())
