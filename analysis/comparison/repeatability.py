"""How two measurements of one motion differ: the covariance of smoothed values by the errors of measurement alone.

A measured jump states, for each smoothed value, a variance that holds both the errors of measurement and how much the
motion may have departed from what the smoother expects. Two measurements of the same motion share the latter, so only
the former says whether two jumps differ. The model over time smooths with a white-noise-on-jerk prior; for a signal
sampled at equal times this is a filter with the frequency response

    S(w) = 1 / (1 + k (2 - 2 cos w)^3),    variance of the smoothed / of the raw value = mean of S over w,

which gives k from the variances. Errors of measurement then have the spectrum S^2, those of rates w^2 S^2, the stated
variance belongs to S and w^2 S. Of the stated variance of values errors of measurement are 5/6, of that of rates 1/2,
if the smoother reaches far. Near the ends of a jump the smoother is one-sided: there nearly all of the variance of
rates is from errors of measurement, so all of it is taken. Before the take-off it is the same: what follows says little
of the motion on the table. Behind it, it is so for vertical velocity and slope of the path: they change when the table
ends, and when that is has been measured, too. The angle of attack is phi, a value, minus the slope of the path, which
is a rate.
"""

from typing import Final

import numpy as np

from analysis.comparison.aligned import ATTACK, HEIGHT, PHI, RATES, VELOCITY, Series
from analysis.result.model import EDGE_S
from rig.arrays import Flags, Floats

_FREQUENCIES: Final = 128
#: The slope of the path stands behind `QUANTITIES`; it is a function of the velocity.
_RATES_AND_PATH: Final = np.append(RATES, True)
#: Rates that change when the table ends: vertical velocity and slope of the path.
_VERTICAL: Final = np.append(np.arange(len(RATES)) == VELOCITY.stop - 1, True)
#: Mean square of what the model over time makes of repeated measurements / that by this approximation: the model
#: estimates how smooth a jump is from the jump itself, so that no two jumps are smoothed quite alike. That is
#: its size for sideways velocity, which tells least of its smoothness; for others it is 0.6 to 1.1, with long tails.
_APPROXIMATE: Final = 1.3
_LEAST_PATH: Final = 0.01  # of the variance of the angle of attack
_STIFFNESSES: Final = np.logspace(-4, 9, 131)


def noise_covariance(series: Series) -> Floats:
    """Covariance (11 T, 11 T) of a jump's smoothed values by the errors of measurement, quantity by quantity."""
    count, times = series.share.shape
    path = np.maximum(series.variance[ATTACK] - series.variance[PHI], _LEAST_PATH * series.variance[ATTACK])
    variance = np.vstack((series.variance, path))
    share = np.vstack((series.share, series.share[HEIGHT]))
    frequencies = (np.arange(_FREQUENCIES) + 0.5) * np.pi / _FREQUENCIES
    amplitude = _amplitude(share, frequencies)
    one_sided = _RATES_AND_PATH[:, None] & _one_sided(series, share)
    amplitude[one_sided] /= np.linalg.norm(amplitude[one_sided], axis=-1, keepdims=True)
    amplitude *= np.sqrt(variance)[..., None]
    phase = series.times[:, None] * series.rate_hz * frequencies
    waves = np.concatenate((amplitude * np.cos(phase), amplitude * np.sin(phase)), axis=-1)
    factor = waves.reshape(len(variance) * times, -1)
    whole = factor @ factor.T * np.kron(series.correlation, np.ones((times, times)))
    blocks = whole.reshape(len(variance), times, len(variance), times)
    blocks[ATTACK] = blocks[PHI] - blocks[count]
    blocks[:, :, ATTACK] = blocks[:, :, PHI] - blocks[:, :, count]
    return np.asarray(_APPROXIMATE * blocks[:count, :, :count].reshape(count * times, count * times))


def _amplitude(share: Floats, frequencies: Floats) -> Floats:
    """(12, T, w) of the errors of measurement, for a stated variance of 1."""
    response = 1 / (1 + _stiffness(share)[..., None] * (2 - 2 * np.cos(frequencies)) ** 3)
    weight = np.where(_RATES_AND_PATH[:, None, None], frequencies**2, 1.0)
    return np.asarray(np.sqrt(weight) * response / np.sqrt((weight * response).sum(axis=-1, keepdims=True)))


def _one_sided(series: Series, share: Floats) -> Flags:
    """Which values (12, T) the smoother's window, 1 / share pulses wide, would take from beyond an end or the edge."""
    times = series.times
    ends = np.minimum(times - series.ends_s[0], series.ends_s[1] - times)
    table = np.minimum(ends, np.where(times <= 0, -times, np.inf))
    flight = np.minimum(ends, np.maximum(times - EDGE_S, 0.0))
    off = np.where(_VERTICAL[:, None] & (times > 0), flight, table)
    return np.asarray(off * series.rate_hz < 0.5 / share)


def _stiffness(share: Floats) -> Floats:
    """The k that gives these shares."""
    frequencies = (np.arange(_FREQUENCIES) + 0.5) * np.pi / _FREQUENCIES
    shares = (1 / (1 + _STIFFNESSES[:, None] * (2 - 2 * np.cos(frequencies)) ** 3)).mean(axis=-1)
    return np.asarray(np.exp(np.interp(share, shares[::-1], np.log(_STIFFNESSES)[::-1])))
