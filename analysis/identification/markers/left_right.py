"""Which binding is the left one, decided over all pulses at once.

A binding that is seen alone looks like the other one, and a wrong pair beside it misleads the prediction of both. So
the points that were taken as bindings get their names once more as one path: hypotheses about all pulses compete, each
with its own filter, and pay for what does not move as bindings do. What nearly as good hypotheses name otherwise is
left out: it cannot be told. The hip goes with them: it is between the bindings, whichever of them is seen.
"""

from dataclasses import dataclass, replace

import numpy as np

from analysis.identification.over_time.assignment import DECISIVE
from analysis.identification.over_time.prediction import PathFilter
from rig.arrays import Flags, Floats, Integers

#: What the two bindings may be at a pulse: index of the point that was taken as the P3 and P4; -1: none.
#: Both as they are, both exchanged, and what else there is.
_CHOICES = np.array([(0, 1), (1, 0), (0, -1), (1, -1), (-1, 0), (-1, 1), (-1, -1)])
#: What they are if their names are right, by whether there is a point of each.
_AS_THEY_ARE = {(True, True): 0, (True, False): 2, (False, True): 5, (False, False): 6}
_HIP = 2  #: its place among the points
_BEAM = 12  #: hypotheses that go on to the next pulse
_FALSE = 0.05  #: share of the points taken as a binding that are none
_WITHIN_M = 1.0  #: edge of the space in which such points were looked for
#: Cost of a point that is no binding but chance.
_BY_CHANCE = float(6 * np.log(_WITHIN_M) - 2 * np.log(_FALSE))


@dataclass(frozen=True, slots=True, eq=False)
class _Hypotheses:
    """Hypotheses about the pulses so far.

    Attributes:
        cost: (h,) minus twice the logarithm of the likelihood.
        chosen: (h, t) index in `_CHOICES`.
        state: (h, s) of the filter.
        variance: (h, s, s) of it.
        begun: (h, p) parts of the filter that were measured.
    """

    cost: Floats
    chosen: Integers
    state: Floats
    variance: Floats
    begun: Flags


def name_bindings(time_s: Floats, xyz: Floats, covariance: Floats, strange: Floats, bindings: PathFilter) -> Integers:
    """The names of what was taken as bindings.

    Args:
        time_s: (t,) of the pulses.
        xyz: (t, 3, 3) points that were taken as the one and the other binding, and the hip; NaN where there is none.
        covariance: (t, 3, 3, 3) of them.
        strange: (t, 2) cost of both being a pair as they are, and exchanged.
        bindings: how both and the hip move.

    Returns:
        (t, 2) which of the two points is the one and which the other binding; -1: none, or not to be told.
    """
    there: Flags = np.asarray(np.isfinite(xyz).all(axis=2))
    xyz, covariance = np.nan_to_num(xyz), np.nan_to_num(covariance)
    ahead = _followed(time_s, there, xyz, covariance, strange, bindings)
    back = _followed(time_s[::-1], there[::-1], xyz[::-1], covariance[::-1], strange[::-1], bindings)
    chosen = np.concatenate((ahead.chosen, back.chosen[:, ::-1]))
    return _told(_CHOICES[chosen], np.concatenate((ahead.cost, back.cost)))


def _followed(
    time_s: Floats, there: Flags, xyz: Floats, covariance: Floats, strange: Floats, bindings: PathFilter
) -> _Hypotheses:
    """The best hypotheses about all pulses, and that all names are right as they are, from one end to the other."""
    mean, sigma = bindings.begin
    none = np.zeros((1, len(bindings.mixing[0])), bool)
    h = _Hypotheses(np.zeros(1), np.zeros((1, 0), int), mean[None], np.diag(sigma**2)[None], none)
    for t in range(len(time_s)):
        if t:
            state, variance = bindings.moved(h.state, h.variance, np.diff(time_s[t - 1 : t + 1]), h.begun)
            h = replace(h, state=state, variance=variance)
        h = _continued(h, there[t], xyz[t], covariance[t], strange[t], bindings)
    return h


def _told(names: Integers, cost: Floats) -> Integers:
    """What all hypotheses name alike that are nearly as good as the best; names (h, t, 2)."""
    best = names[int(cost.argmin())]
    rivals = names[np.flatnonzero(cost - cost.min() < DECISIVE)]
    return np.where(np.any(rivals != best, axis=0), -1, best)


def _continued(
    h: _Hypotheses, there: Flags, xyz: Floats, covariance: Floats, strange: Floats, bindings: PathFilter
) -> _Hypotheses:
    """The best hypotheses after one more pulse: there (3,), xyz (3, 3), covariance (3, 3, 3) of its points.

    The first one is that all names are right.
    """
    options = [c for c, pair in enumerate(_CHOICES.tolist()) if all(there[p] for p in pair if p >= 0)]
    costs = np.stack([_cost(h, _CHOICES[c], there, xyz, covariance, bindings) for c in options])
    for place, option in enumerate(options):
        costs[place] += strange[option] if option < len(strange) else 0.0
    as_they_are = options.index(_AS_THEY_ARE[bool(there[0]), bool(there[1])]) * len(h.cost)
    order = np.argsort(costs, axis=None)
    order = order[(costs.ravel()[order] < costs.min() + 2 * DECISIVE) & (order != as_they_are)]
    order = np.append(as_they_are, order[:_BEAM])
    which, came = np.unravel_index(order, costs.shape)
    state, variance, begun = h.state[came], h.variance[came], h.begun[came]
    for place, option in enumerate(options):
        chosen = which == place
        seen, points = _used(_CHOICES[option], there)
        if chosen.any() and seen.any():
            new = _updated(state[chosen], variance[chosen], seen, xyz[points], covariance[points], bindings)
            state[chosen], variance[chosen] = new
            begun[chosen] |= (bindings.mixing[seen] != 0).any(axis=0)
    chosen = np.column_stack((h.chosen[came], np.array(options)[which]))
    return _Hypotheses(costs.ravel()[order], chosen, state, variance, begun)


def _cost(
    h: _Hypotheses, choice: Integers, there: Flags, xyz: Floats, covariance: Floats, bindings: PathFilter
) -> Floats:
    """Costs (h,) of the hypotheses if they go on with a choice."""
    seen, points = _used(choice, there)
    cost = h.cost + _BY_CHANCE * float(there.sum() - seen.sum())
    if not seen.any():
        return np.asarray(cost)
    off, total, _ = _innovation(h.state, h.variance, seen, xyz[points], covariance[points], bindings)
    squares = np.einsum("hi,hi->h", off, np.linalg.solve(total, off[..., None])[..., 0])
    return np.asarray(cost + squares + np.linalg.slogdet(2 * np.pi * total)[1])


def _used(choice: Integers, there: Flags) -> tuple[Flags, Integers]:
    """Which things (3,) a choice sees, the hip where it is, and the points that show them."""
    of_things = np.append(choice, _HIP if there[_HIP] else -1)
    return np.asarray(of_things >= 0), of_things[of_things >= 0]


def _updated(
    state: Floats, variance: Floats, seen: Flags, xyz: Floats, covariance: Floats, bindings: PathFilter
) -> tuple[Floats, Floats]:
    off, total, by_state = _innovation(state, variance, seen, xyz, covariance, bindings)
    gain = np.linalg.solve(total, by_state @ variance).swapaxes(-1, -2)
    variance = variance - gain @ by_state @ variance
    return state + (gain @ off[..., None])[..., 0], (variance + variance.swapaxes(-1, -2)) / 2


def _innovation(
    state: Floats, variance: Floats, seen: Flags, xyz: Floats, covariance: Floats, bindings: PathFilter
) -> tuple[Floats, Floats, Floats]:
    """How far points (n, 3) are from where states (h, s) expect the things that are seen (3,), with covariances."""
    by_state = bindings.all_of[np.repeat(seen, 3)]
    total = by_state @ variance @ by_state.T
    for i, own in enumerate(covariance):
        total[:, 3 * i : 3 * i + 3, 3 * i : 3 * i + 3] += own
    return xyz.ravel() - state @ by_state.T, total, by_state
