"""The take-off time as an unknown: when the motion of O stops to be that of the table.

For each possible time the likelihood of the path of O follows from its prior with the break at that time (a Kalman
filter gives it, for all times at once). What is stated is mean and standard deviation of the normalised likelihood.
The states of the bundle serve as points of linearisation only: O and its covariance come from each pulse's own
measurements, with the other channels as uncertain as the bundle says.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.motion.adjustment.bundle import Adjusted
from analysis.motion.model.channels import CHANNELS, ORIGIN, SLOPE, START_SIGMA
from analysis.motion.model.observations import GROUPS
from analysis.motion.model.prior import Prior, prior
from analysis.result.model import EDGE_S
from rig.arrays import Floats

_COARSE_S: Final = 1 / 60  # steps of the search
_NODES_SPREAD, _MOST_LEAN = 3.0, 2.0  # a b and |b - a| of the outer nodes mean - a and mean + b, in sigmas
_FINE: Final = 41  # times of the final grid
_SUPPORT: Final = 8.0  # of log-likelihood below the greatest: less likely times do not count
#: Acceleration of O in the first pulse, m/s^2 (Z up): of a table, and of a flight. Their spread covers any in-run.
_ON_TABLE: Final = (np.array((0.0, 0.0, 0.0)), np.array((5.0, 3.0, 3.0)))
_IN_FLIGHT: Final = (np.array((-2.0, 0.0, -6.0)), np.array((3.0, 3.0, 3.0)))
#: The end of an in-run is straight, and before that it bends up: on it O gains downward speed only by its slope, less
#: than 0.4 m/s^2. In flight it falls by 9.8 m/s^2 less the lift, which is half of it at most.
_FALLING_M_S2: Final = -2.0
_BEFORE_S: Final = 0.5  # of the path before the break that tells whether it is a table
_CERTAIN: Final = 2.0  # sigmas
_AT_END: Final = 2.0  # pulses: a break nearer to the first or last intersected binding or ski is none
_BELOW: Final = slice(GROUPS.index("P3"), len(GROUPS))  # bindings and skis
_SINGULAR: Final = 1e12  # condition of a parabola through too few places
_LOOSE: Final = 1e4  # m or rad: weak weight that keeps undetermined pulses solvable
#: Channels that the table guides: O and the slope of the skis.
_SELECTED: Final = (*range(ORIGIN.start, ORIGIN.stop), SLOPE)


@dataclass(frozen=True, slots=True)
class Break:
    """The take-off in the time of `Observations.times`.

    Attributes:
        seconds: its mean.
        sigma: its standard deviation, s.
        nodes: possible times that with their weights stand for its distribution; the middle one is `seconds`.
        weights: of the nodes; their sum is 1.
    """

    seconds: float
    sigma: float
    nodes: tuple[float, float, float]
    weights: tuple[float, float, float]


def find_break(adjusted: Adjusted, densities: Floats) -> Break | None:
    """The take-off; None where the motion shows none.

    Args:
        adjusted: the bundle, with whatever take-off.
        densities: (3, 8) of the prior of the motion.
    """
    times, unit = adjusted.model.observed.times, adjusted.model.prior.unit
    path = _path(adjusted)
    known = _known(adjusted)
    first, last = known[0] + _AT_END * unit, known[-1] - _AT_END * unit
    coarse = np.arange(times[0], times[-1], max(_COARSE_S, unit / 2))
    likelihood = _log_likelihood(path, times, prior(times, unit, coarse, densities), _ON_TABLE)
    if likelihood.max() < _without(path, times, unit, densities):
        return None
    possible = coarse[likelihood > likelihood.max() - _SUPPORT]
    step = coarse[1] - coarse[0] if len(coarse) > 1 else unit
    fine = np.linspace(max(possible[0] - step, times[0]), min(possible[-1] + step, times[-1]), _FINE)
    likelihood = _log_likelihood(path, times, prior(times, unit, fine, densities), _ON_TABLE)
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    mean = float(weight @ fine)
    if not first <= mean <= last:
        return None
    if _falls_before(path, times, mean):
        return None
    sigma = float(np.sqrt(weight @ (fine - mean) ** 2 + (fine[1] - fine[0]) ** 2 / 12))
    return Break(mean, sigma, *_three_nodes(mean, sigma, float(weight @ (fine - mean) ** 3)))


def _falls_before(path: "_Path", times: Floats, seconds: float) -> bool:
    """Whether O falls freely before a break: then it flies already, and the break is not the edge of a table."""
    of = (times < seconds) & (times > seconds - _BEFORE_S)
    since = times[of] - seconds
    height, weight = path.value[of, 2], 1.0 / path.covariance[of, 2, 2]
    design = np.column_stack((np.ones(len(since)), since, since**2 / 2))
    normal = design.T @ (weight[:, None] * design)
    if len(since) < design.shape[1] or np.linalg.cond(normal) > _SINGULAR:
        return False
    covariance = np.linalg.inv(normal)
    fall = float(covariance[2] @ (design.T @ (weight * (height - height.mean()))))
    return fall + _CERTAIN * float(np.sqrt(covariance[2, 2])) < _FALLING_M_S2


def airborne(adjusted: Adjusted) -> float:
    """Since when he flies for sure, s, if no take-off was found: it may be older than the first known place of O."""
    return float(_known(adjusted)[0]) + _AT_END * adjusted.model.prior.unit + EDGE_S


def _known(adjusted: Adjusted) -> Floats:
    """Times of the pulses in which a binding or a ski was intersected; all of them if none was."""
    times = adjusted.model.observed.times
    place = (adjusted.used[:, :, _BELOW].sum(axis=1) >= 2).any(axis=1)
    return times[place] if place.any() else times


def passing(adjusted: Adjusted, edge: Floats) -> Break | None:
    """When O passes a known edge: the vertical plane across the flight through a point of it.

    Args:
        adjusted: the bundle.
        edge: (3,) the point, object system; its own error is not part of the result.
    """
    model, states = adjusted.model, adjusted.states
    times, unit = model.observed.times, model.prior.unit
    ahead = float((edge - model.frame.origin) @ model.frame.rotation[:, 0]) - states[:, 0]
    reached = np.flatnonzero((ahead[:-1] > 0) & (ahead[1:] <= 0))
    if not len(reached):
        return None
    k = int(reached[0]) if ahead[reached[0]] < -ahead[reached[0] + 1] else int(reached[0]) + 1
    speed = states[k, CHANNELS] / unit
    sigma = float(np.sqrt(adjusted.solution.covariance[k, 0, 0])) / speed
    seconds = float(times[k] + ahead[k] / speed)
    return Break(seconds, sigma, *_three_nodes(seconds, sigma, 0.0))


def _three_nodes(
    mean: float, sigma: float, third: float
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Mean and two nodes around it that, weighted, have the mean, variance and third moment of a distribution.

    For a normal distribution they are those of Gauss and Hermite: sqrt(3) sigma aside, with a weight of 1/6 each.
    """
    lean = float(np.clip(third / sigma**2, -_MOST_LEAN * sigma, _MOST_LEAN * sigma))
    # Nodes mean - a and mean + b: variance p a^2 + q b^2, third moment q b^3 - p a^3; b - a = lean, a b = 3 sigma^2.
    a = (-lean + np.sqrt(lean**2 + 4 * _NODES_SPREAD * sigma**2)) / 2
    b = a + lean
    p, q = sigma**2 / (a * (a + b)), sigma**2 / (b * (a + b))
    return (mean - a, mean, mean + b), (p, 1 - p - q, q)


@dataclass(frozen=True, slots=True, eq=False)
class _Path:
    """Selected channels (n, c) of each pulse alone, and their covariance (n, c, c)."""

    value: Floats
    covariance: Floats


def _path(adjusted: Adjusted) -> _Path:
    n = len(adjusted.states)
    rows = np.where(adjusted.used[..., None, None], adjusted.equations.by_channels, 0.0).reshape(n, -1, CHANNELS)
    v = np.where(adjusted.used[..., None], adjusted.equations.v, 0.0).reshape(n, -1)
    variance = np.diagonal(adjusted.solution.covariance, axis1=1, axis2=2)[:, :CHANNELS]
    weight = np.minimum(1.0 / variance, 1e12)
    weight[:, list(_SELECTED)] = _LOOSE**-2.0
    inverse = np.linalg.inv(rows.transpose(0, 2, 1) @ rows + weight[:, None] * np.eye(CHANNELS))
    shift = np.einsum("ncd,nrd,nr->nc", inverse, rows, v)
    pick = list(_SELECTED)
    return _Path((adjusted.states[:, :CHANNELS] - shift)[:, pick], np.asarray(inverse[:, pick][:, :, pick], float))


def _without(path: _Path, times: Floats, unit: float, densities: Floats) -> float:
    """Logarithm of the likelihood of a path that is all table or all flight, whichever is likelier."""
    best = -np.inf
    for regime, start in ((0, _ON_TABLE), (2, _IN_FLIGHT)):
        only = prior(times, unit, None, np.repeat(densities[regime : regime + 1], 3, axis=0))
        best = max(best, float(_log_likelihood(path, times, only, start)[0]))
    return best


def _log_likelihood(path: _Path, times: Floats, given: Prior, start: tuple[Floats, Floats]) -> Floats:
    """Logarithm of the likelihood of a path for a prior, of g possible times of the take-off (g,), up to a constant.

    `start` holds mean and standard deviation of the acceleration of O in the first pulse.
    """
    c, n = len(_SELECTED), len(times)
    scale = np.array((1.0, given.unit, given.unit**2 / 2))
    noise = given.noise(np.array(_SELECTED))
    noise = _spread(noise.reshape(-1, *noise.shape[-4:]))
    g = len(noise)
    move = np.einsum("kij,cd->kicjd", given.transition, np.eye(c)).reshape(-1, 3 * c, 3 * c)
    sigma = START_SIGMA[:, list(_SELECTED)].copy()
    sigma[2, ORIGIN] = start[1]
    mean = np.zeros((g, 3 * c))
    mean[:, :c] = path.value[0]
    mean[:, 2 * c : 2 * c + 3] = start[0] * scale[2]
    covariance = np.broadcast_to(np.diag((sigma * scale[:, None]).ravel() ** 2), (g, 3 * c, 3 * c))
    innovation, spread = np.empty((n, g, c)), np.empty((n, g, c, c))
    for k in range(n):
        if k:
            mean = mean @ move[k - 1].T
            for _ in range(2):  # the columns, then the rows: one product for all g
                covariance = (covariance.reshape(-1, 3 * c) @ move[k - 1].T).reshape(g, 3 * c, 3 * c).swapaxes(1, 2)
            covariance = covariance + noise[:, k - 1]
        innovation[k] = path.value[k] - mean[:, :c]
        spread[k] = covariance[:, :c, :c] + path.covariance[k]
        cross = covariance[:, :, :c]
        gain = cross @ np.linalg.inv(spread[k])
        mean = mean + (gain @ innovation[k][..., None])[..., 0]
        covariance = covariance - gain @ cross.swapaxes(1, 2)
        covariance = (covariance + covariance.swapaxes(1, 2)) / 2
    pull = np.linalg.solve(spread, innovation[..., None])[..., 0]
    return np.asarray(-((innovation * pull).sum(axis=-1) + np.linalg.slogdet(spread)[1]).sum(axis=0) / 2)


def _spread(noise: Floats) -> Floats:
    """(g, k, 3 c, 3 c) from blocks (g, k, c, 3, 3) of single channels."""
    g, k, c = noise.shape[:3]
    return np.asarray(np.einsum("gkcij,cd->gkicjd", noise, np.eye(c)).reshape(g, k, 3 * c, 3 * c))
