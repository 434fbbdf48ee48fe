"""Gross errors in the bundle: tests of every measurement, alone and together with its neighbours in time.

An error of one image is far from what all other measurements say. One that lasts is not, if little else determines the
same: a marker half behind an arm, or a shadow taken for the ski, is wrong in the same way for some tenths of a second,
and each of its measurements agrees with the others. So all measurements of a thing in one camera within such a time are
tested together for an error that they share. As in networks, nothing is accused beside a rival that explains as
much (Baarda's data snooping with two alternatives); of measurements in plenty, suspect and rivals are all left out.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.measurements.model import POINTS, SIDES
from analysis.motion.bundle import MEDIAN, Adjusted, rows_by_shared, settled
from analysis.motion.channels import CHANNELS
from analysis.motion.lasting import LASTING_S, pulls, runs
from analysis.motion.observations import GROUPS
from analysis.motion.prior import STATE
from rig.arrays import Flags, Floats, Integers

#: Probability that a jump without gross errors loses any measurement that others of the pulse control.
FALSE_REMOVAL_P: Final = 0.05
_ALONE_P: Final = 0.01  # that a right ray which is alone is lost
_SIGNIFICANT: Final = 3.1  # sigmas; right ones are held for too small with a probability of 0.001
_FLOOR: Final = 1e-4  # of an observation's variance: residuals that are less free tell nothing
_PSEUDO: Final = 10.0  #: observations that a factor of 1 counts as
_POINTS, _SKIS = slice(0, len(POINTS)), slice(len(POINTS), len(GROUPS))
_RIVAL_P: Final = 1e-3  # a suspect that is not that unlikely beside another one has a rival in it


def fitting_sigmas(adjusted: Adjusted, most: int) -> tuple[Adjusted, Floats]:
    """Enlarge the sigmas of all points, or of all skis, if most of them agree worse than their sigmas allow.

    The median of the tests decides, so that gross errors do not count. Returns the factors (6,) of the groups too.
    """
    factors = np.ones(6)
    for _ in range(most):
        tests, step = statistics(adjusted).test, np.ones(6)
        for kind in (slice(0, 4), slice(4, 6)):
            own = tests[:, :, kind][adjusted.used[:, :, kind]]
            ratio = float(np.median(own)) / MEDIAN if len(own) else 1.0
            # The median of n exponential numbers scatters by 1 / (sqrt(n) ln 2) of itself.
            if ratio > 1 + _SIGNIFICANT / (np.sqrt(max(len(own), 1)) * np.log(2.0)):
                step[kind] = np.sqrt(ratio)
        if (step == 1.0).all():
            break
        factors *= step
        model = replace(adjusted.model, observed=adjusted.model.observed.scaled(np.stack((step, step), axis=-1)))
        adjusted = settled(replace(adjusted, model=model), 2)
    return adjusted, factors


def with_factors(adjusted: Adjusted) -> Adjusted:
    """The bundle with sigmas as large as its residuals, gross errors left out, say: smaller ones, too.

    What an image tells of its own sigma is right in proportion, but how much a model of grey values errs depends on the
    hill. Variance components: the square sum of the residuals over their redundancy, for all points, and apart from
    each other for shifts and turns of the axes of skis, since what both edges do in common shifts an axis and does not
    turn it (Helmert's estimator, as in `prior`).
    """
    observed, used = adjusted.model.observed, adjusted.used
    turned = observed.to_mean_and_difference()
    free = np.eye(2) - turned @ _of_adjusted(adjusted) @ turned.swapaxes(-1, -2)
    square = np.where(used[..., None], (turned @ adjusted.equations.v[..., None])[..., 0] ** 2, 0.0).sum(axis=(0, 1))
    redundancy = np.where(used[..., None], np.diagonal(free, axis1=-2, axis2=-1), 0.0).sum(axis=(0, 1))
    of_points = (square[_POINTS].sum() + _PSEUDO) / (redundancy[_POINTS].sum() + _PSEUDO)
    of_skis = (square[_SKIS].sum(axis=0) + _PSEUDO) / (redundancy[_SKIS].sum(axis=0) + _PSEUDO)
    factors = np.sqrt(np.concatenate((np.full((len(POINTS), 2), of_points), np.tile(of_skis, (len(SIDES), 1)))))
    model = replace(adjusted.model, observed=observed.scaled(factors))
    return settled(replace(adjusted, model=model), 2)


def without_gross_errors(adjusted: Adjusted, most: int) -> Adjusted:
    """Leave out measurements that contradict all others, the worst around first; take back those that no longer do.

    Where two of a point's rays had to go and a single one is left, nothing tells that it is the right one: it goes too.
    A point that one camera alone sees in a pulse is judged more severely: nothing else of that pulse controls it, so a
    wrong one does harm, and a right one is of little use. Errors that last are looked for when single ones are gone;
    what they take is not taken back.
    """
    seen = adjusted.model.observed.seen
    alone = (seen.sum(axis=1, keepdims=True) == 1) & (np.arange(len(GROUPS)) < len(POINTS))
    limit = chdtri(2, np.where(alone, _ALONE_P, FALSE_REMOVAL_P / max(int(seen.sum()), 1)))
    doubtful = np.zeros(seen.shape, bool)
    for _ in range(most):
        excess = statistics(adjusted).test / limit
        worst = np.where(adjusted.used, excess, 0.0).max(axis=(1, 2))
        around = np.lib.stride_tricks.sliding_window_view(np.pad(worst, 1), 3).max(axis=1)
        leave = adjusted.used & (excess > 1) & (excess >= around[:, None, None])
        kept = adjusted.used & ~leave
        used = kept | (seen & ~adjusted.used & (excess < 1))
        lone = (used.sum(axis=1, keepdims=True) == 1) & ((seen & ~used).sum(axis=1, keepdims=True) >= 2)
        doubtful |= lone
        used &= ~doubtful
        if (used == adjusted.used).all():
            lasting = lasting_errors(adjusted)
            if not lasting.any():
                return adjusted
            doubtful |= lasting
            used &= ~doubtful
        adjusted = settled(replace(adjusted, used=used), 2)
    return adjusted


@dataclass(frozen=True, slots=True, eq=False)
class Statistics:
    """Of each group (n, m, 6).

    Attributes:
        square: weighted square sum of its residuals.
        redundancy: its share in the degrees of freedom, 0..2; 0 where it was not used.
        test: chi-squared of two degrees of freedom: how far the measurement is from what all others say of it.
    """

    square: Floats
    redundancy: Floats
    test: Floats


def statistics(adjusted: Adjusted) -> Statistics:
    """Residuals, redundancies and tests of all groups."""
    spread = _of_adjusted(adjusted)
    v, unit = adjusted.equations.v, np.eye(2)
    used = adjusted.used[..., None, None]
    free = np.where(used, unit * (1 + _FLOOR) - spread, unit + spread)
    test = np.einsum("...a,...ab,...b->...", v, np.linalg.inv(free), v)
    redundancy = np.where(adjusted.used, 2.0 - np.trace(spread, axis1=-2, axis2=-1), 0.0)
    return Statistics((v**2).sum(axis=-1), redundancy, test)


def _of_adjusted(adjusted: Adjusted) -> Floats:
    """Covariances (n, m, 6, 2, 2) of the adjusted observations, divided by those of the measurements."""
    solution, instants = adjusted.solution, adjusted.instants
    rows, border = adjusted.equations.by_channels, rows_by_shared(adjusted)
    n, m = adjusted.used.shape[:2]
    spread = np.empty((n, m, 6, 2, 2))
    for i in range(m):
        own = np.einsum(
            "d,ndcef,e->ncf", instants[i], solution.covariance.reshape(n, 3, CHANNELS, 3, CHANNELS), instants[i]
        )
        cross = np.einsum("d,ndcb->ncb", instants[i], solution.cross.reshape(n, 3, CHANNELS, -1))
        flat, shared = rows[:, i].reshape(n, 12, CHANNELS), border[:, i].reshape(n, 12, -1)
        half = (flat @ cross @ shared.transpose(0, 2, 1)).reshape(n, 6, 2, 6, 2)
        whole = (flat @ own @ flat.transpose(0, 2, 1)).reshape(n, 6, 2, 6, 2)
        whole += half + half.transpose(0, 3, 4, 1, 2)
        whole += (shared @ solution.shared_covariance @ shared.transpose(0, 2, 1)).reshape(n, 6, 2, 6, 2)
        spread[:, i] = np.einsum("ngagb->ngab", whole)
    return spread


def lasting_errors(adjusted: Adjusted) -> Flags:
    """Which measurements (n, m, 6) share an error, or may: of each time the worst ones, and their rivals.

    An error that lasts counts as gross if it is too large for a single measurement. Smaller ones are let be: errors of
    neighbouring images are never quite independent.
    """
    windows = _windows(adjusted)
    out = np.zeros_like(adjusted.used)
    if not windows.middle.size:
        return out
    tests = np.array([windows.test((w,)) for w in range(len(windows.middle))])
    limit, rival = float(chdtri(2, FALSE_REMOVAL_P / len(tests))), float(chdtri(2, _RIVAL_P))
    for w in np.flatnonzero(tests > limit):
        near = np.flatnonzero(np.abs(windows.middle - windows.middle[w]) < LASTING_S)
        if tests[w] < tests[near].max():
            continue
        for other in near[tests[near] > tests[w] - rival]:
            if other == w or windows.test((int(w), int(other))) - tests[other] < rival:
                out |= windows.members == other
    return out


@dataclass(frozen=True, slots=True, eq=False)
class _Windows:
    """Measurements of one thing in one camera in neighbouring pulses: w windows, each with an error of its own.

    Attributes:
        members: (n, m, 6) window of each measurement that takes part; -1 where there is none.
        middle: (w,) s, its mean time.
        pull: (w, 2) right-hand side of the shared errors (x and y, or at both points of a ski), 1/px.
        normal: (w, w, 2, 2) their normal equations when all other unknowns are eliminated, 1/px^2.
        single: (w, 2, 2) mean covariance of one measurement, px^2.
    """

    members: Integers
    middle: Floats
    pull: Floats
    normal: Floats
    single: Floats

    def test(self, which: tuple[int, ...]) -> float:
        """Chi-squared of two degrees of freedom for each window: that they have errors that single ones have not."""
        size, chosen = 2 * len(which), list(which)
        normal = self.normal[np.ix_(chosen, chosen)].transpose(0, 2, 1, 3).reshape(size, size)
        allowed = np.zeros((size, size))
        for k, w in enumerate(chosen):
            allowed[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = self.single[w]
        pull = self.pull[chosen].ravel()
        return float(pull @ np.linalg.solve(normal + normal @ allowed @ normal, pull))


def _windows(adjusted: Adjusted) -> _Windows:
    """Eliminate all unknowns of the bundle from the normal equations of the windows' errors."""
    observed, used = adjusted.model.observed, adjusted.used
    members = np.full(used.shape, -1)
    found = [
        run
        for i in range(used.shape[1])
        for g in range(used.shape[2])
        for run in runs(adjusted, i, g, LASTING_S)
        if len(run.pulses) > 1
    ]
    count = len(found)
    pull, own = np.zeros((count, 2)), np.zeros((count, 2, 2))
    for w, run in enumerate(found):
        at = run.pulses, run.camera, run.group
        members[at] = w
        white = observed.whitener[at]
        pull[w] = np.einsum("pab,pa->b", white, adjusted.equations.v[at])
        own[w] = np.einsum("pab,pac->bc", white, white)
    by_states, by_shared = pulls(adjusted, found, [np.tile(np.eye(2), (len(run.pulses), 1, 1)) for run in found])
    spread = adjusted.solution.covariance_of(
        by_states.reshape(len(used), STATE, -1), by_shared.reshape(len(by_shared), -1)
    )
    normal = -spread.reshape(count, 2, count, 2).transpose(0, 2, 1, 3)
    normal[range(count), range(count)] += (1 + _FLOOR) * own
    sizes = np.array([len(run.pulses) for run in found])
    single = np.linalg.inv(own) * sizes[:, None, None] if count else own
    middle = np.array([observed.times[run.pulses].mean() for run in found])
    return _Windows(members, middle, pull, normal, single)
