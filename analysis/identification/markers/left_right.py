"""Which binding is the left one, decided over all pulses at once.

A binding that is seen alone looks like the other one, and a wrong pair misleads the prediction of both bindings. So
the points that were taken as bindings get their names once more as one path: hypotheses about all pulses compete, each
with its own filter, at a cost for each movement that is unlike a binding's. A point stays without a name where a
hypothesis that is nearly as good as the best names it otherwise. The filters also follow the hip, which is between the
bindings, whichever of them is seen.

A false point may be a thing that moves with the body, such as a glove. Its points in later pulses are then no further
evidence of chance, so a hypothesis pays the full cost for the first of them only.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.identification.over_time.assignment import DECISIVE
from analysis.identification.over_time.prediction import PathFilter
from rig.arrays import Flags, Floats, Integers

#: What the two bindings may be at a pulse: index of the point that was taken as the P3 and P4; -1: none.
#: Both as they are, both exchanged, and what else there is.
_CHOICES = np.array([(0, 1), (1, 0), (0, -1), (1, -1), (-1, 0), (-1, 1), (-1, -1)])
#: The choice that keeps both names, by whether the right and the left binding have a point.
_AS_THEY_ARE = {(True, True): 0, (True, False): 2, (False, True): 5, (False, False): 6}
_HIP = 2  #: its place among the points
_VELOCITY = slice(3, 6)  #: of the first part of `bindings`, their midpoint, in a state
_BEAM = 12  #: hypotheses that go on to the next pulse
_FALSE = 0.05  #: share of false points among those taken as a binding
_WITHIN_M = 1.0  #: edge of the space in which such points were looked for
#: Cost of a false point.
_BY_CHANCE = float(6 * np.log(_WITHIN_M) - 2 * np.log(_FALSE))
_LIMBS_M_S = 4.0  #: standard deviation of the velocity of a thing that goes along with the body against the bindings'


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """What was taken as bindings, and the hip, at one pulse.

    Attributes:
        there: (3,) whether there is a point of each.
        xyz: (3, 3) m.
        covariance: (3, 3, 3).
        strange: (2,) cost of both bindings being a pair as they are, and exchanged.
    """

    there: Flags
    xyz: Floats
    covariance: Floats
    strange: Floats


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
    """The names of the points that were taken as bindings.

    Args:
        time_s: (t,) of the pulses.
        xyz: (t, 3, 3) points that were taken as the one and the other binding, and the hip; NaN where there is none.
        covariance: (t, 3, 3, 3) of them.
        strange: (t, 2) cost of both being a pair as they are, and exchanged.
        bindings: how both and the hip move.

    Returns:
        (t, 2) index of the point that is the right, and the left binding; -1: none, or undecided.
    """
    there: Flags = np.asarray(np.isfinite(xyz).all(axis=2))
    parts = zip(there, np.nan_to_num(xyz), np.nan_to_num(covariance), strange, strict=True)
    points = [_Points(*of_pulse) for of_pulse in parts]
    ahead = _followed(time_s, points, bindings)
    back = _followed(time_s[::-1], points[::-1], bindings)
    chosen = np.concatenate((ahead.chosen, back.chosen[:, ::-1]))
    return _told(_CHOICES[chosen], np.concatenate((ahead.cost, back.cost)))


def _followed(time_s: Floats, points: Sequence[_Points], bindings: PathFilter) -> _Hypotheses:
    """The best hypotheses about all pulses, in their given order; among them that all names are right."""
    mean, sigma = bindings.begin
    none = np.zeros((1, len(bindings.mixing[0])), bool)
    h = _Hypotheses(np.zeros(1), np.zeros((1, 0), int), mean[None], np.diag(sigma**2)[None], none)
    for t, here in enumerate(points):
        by_chance = np.full((len(h.cost), 2), _BY_CHANCE)
        if t:
            dt = np.diff(time_s[t - 1 : t + 1])
            state, variance = bindings.moved(h.state, h.variance, dt, h.begun)
            h = replace(h, state=state, variance=variance)
            by_chance = _by_chance(h, points[t - 1], here, float(dt[0]))
        h = _continued(h, here, by_chance, bindings)
    return h


def _by_chance(h: _Hypotheses, before: _Points, here: _Points, dt: float) -> Floats:
    """Costs (h, 2) of each point being no binding: less for a thing that was none at the pulse before either."""
    way = h.state[:, None, _VELOCITY] * dt
    off = here.xyz[:2] - before.xyz[:2] - way
    total = here.covariance[:2] + before.covariance[:2] + (_LIMBS_M_S * dt) ** 2 * np.eye(3)
    total = total + h.variance[:, None, _VELOCITY, _VELOCITY] * dt**2
    squares = np.einsum("hpi,hpi->hp", off, np.linalg.solve(total, off[..., None])[..., 0])
    lasting = squares + np.linalg.slogdet(2 * np.pi * total)[1]
    used = np.any(_CHOICES[h.chosen[:, -1]][..., None] == np.arange(2), axis=1)
    return np.where(before.there[:2] & here.there[:2] & ~used, np.minimum(lasting, _BY_CHANCE), _BY_CHANCE)


def _told(names: Integers, cost: Floats) -> Integers:
    """The names on which all hypotheses agree that are nearly as good as the best; names (h, t, 2)."""
    best = names[int(cost.argmin())]
    rivals = names[np.flatnonzero(cost - cost.min() < DECISIVE)]
    return np.where(np.any(rivals != best, axis=0), -1, best)


def _continued(h: _Hypotheses, here: _Points, by_chance: Floats, bindings: PathFilter) -> _Hypotheses:
    """The best hypotheses after one more pulse; by_chance (h, 2) costs of its points being no bindings.

    The first one is that all names are right.
    """
    there = here.there
    options = [c for c, pair in enumerate(_CHOICES.tolist()) if all(there[p] for p in pair if p >= 0)]
    costs = np.stack([_cost(h, _CHOICES[c], here, by_chance, bindings) for c in options])
    for place, option in enumerate(options):
        costs[place] += here.strange[option] if option < len(here.strange) else 0.0
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
            new = _updated(state[chosen], variance[chosen], seen, here.xyz[points], here.covariance[points], bindings)
            state[chosen], variance[chosen] = new
            begun[chosen] |= (bindings.mixing[seen] != 0).any(axis=0)
    chosen = np.column_stack((h.chosen[came], np.array(options)[which]))
    return _Hypotheses(costs.ravel()[order], chosen, state, variance, begun)


def _cost(h: _Hypotheses, choice: Integers, here: _Points, by_chance: Floats, bindings: PathFilter) -> Floats:
    """Costs (h,) of the hypotheses if they go on with a choice."""
    seen, points = _used(choice, here.there)
    false = [p for p in range(2) if here.there[p] and p not in points]
    cost = h.cost + by_chance[:, false].sum(axis=1)
    if not seen.any():
        return np.asarray(cost)
    off, total, _ = _innovation(h.state, h.variance, seen, here.xyz[points], here.covariance[points], bindings)
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
