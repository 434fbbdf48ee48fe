"""Gross errors in the bundle: tests of every measurement, alone and together with its neighbours in time.

An error of one image is far from what all other measurements say. A lasting error is not, where few other measurements
determine the same quantity: a marker half behind an arm, or a shadow taken for the ski, is wrong in the same way for
some tenths of a second, and each of its measurements agrees with the others. So all measurements of a thing in one
camera within such a time are tested together for an error that they share. As in networks, no measurement is left out
alone if a rival explains as much (Baarda's data snooping with two alternatives); of measurements in plenty, suspect and
rivals are all left out.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.measurements.model import POINTS, SIDES
from analysis.motion.adjustment.bundle import MEDIAN, Adjusted, rows_by_shared, settled
from analysis.motion.adjustment.lasting import LASTING_S, pulls, runs
from analysis.motion.model.channels import CHANNELS
from analysis.motion.model.observations import GROUPS
from rig.arrays import Flags, Floats, Integers

#: Probability that a jump without gross errors loses any measurement that others of the pulse control.
FALSE_REMOVAL_P: Final = 0.05
_ALONE_P: Final = 0.01  # that a right ray which is alone is lost
_SIGNIFICANT: Final = 3.1  # sigmas; right ones are held for too small with a probability of 0.001
_FLOOR: Final = 1e-4  # of an observation's variance: residuals that are less free tell nothing
_PSEUDO: Final = 10.0  #: observations that a factor of 1 counts as
_POINTS, _SKIS = slice(0, len(POINTS)), slice(len(POINTS), len(GROUPS))
_RUN_S: Final = LASTING_S / 2 - 1e-3  # to each side of a measurement; less 1 ms, since times are rounded
_RAYS_NO_CHANCE: Final = 2  # gross errors that are no coincidence: one in ten thousand rays is one by chance
_TIMES_LEFT_OUT: Final = 2  # times that a measurement is left out, after which it is not taken back
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
    # The covariance is that of the step before: where hardly anything is left over, numbers may lie beyond the limits.
    numbers = np.clip(np.diagonal(free, axis1=-2, axis2=-1), 0.0, 1.0)
    redundancy = np.where(used[..., None], numbers, 0.0).sum(axis=(0, 1))
    of_points = (square[_POINTS].sum() + _PSEUDO) / (redundancy[_POINTS].sum() + _PSEUDO)
    of_skis = (square[_SKIS].sum(axis=0) + _PSEUDO) / (redundancy[_SKIS].sum(axis=0) + _PSEUDO)
    factors = np.sqrt(np.concatenate((np.full((len(POINTS), 2), of_points), np.tile(of_skis, (len(SIDES), 1)))))
    model = replace(adjusted.model, observed=observed.scaled(factors))
    return settled(replace(adjusted, model=model), 2)


def without_gross_errors(adjusted: Adjusted, most: int) -> Adjusted:
    """Leave out measurements that contradict all others, the worst around first; take them back once they agree.

    Where two of a point's rays had to go and a single one is left, nothing tells that it is the right one: it goes too.
    So do those few of a camera that stand among more that had to go (`deserted`).
    A point that one camera alone sees in a pulse is judged more severely: nothing else of that pulse controls it, so a
    wrong one does harm, and a right one is of little use. Errors that last are looked for when single ones are gone;
    what they take is not taken back.
    """
    seen = adjusted.model.observed.seen
    points = np.arange(len(GROUPS)) < len(POINTS)
    doubtful, left = np.zeros(seen.shape, bool), np.zeros(seen.shape, int)
    for _ in range(most):
        alone = ((seen & ~doubtful).sum(axis=1, keepdims=True) == 1) & points
        limit = chdtri(2, np.where(alone, _ALONE_P, FALSE_REMOVAL_P / max(int(seen.sum()), 1)))
        excess = statistics(adjusted).test / limit
        worst = np.where(adjusted.used, excess, 0.0).max(axis=(1, 2))
        around = np.lib.stride_tricks.sliding_window_view(np.pad(worst, 1), 3).max(axis=1)
        leave = adjusted.used & (excess > 1) & (excess >= around[:, None, None])
        left += leave
        kept = adjusted.used & ~leave
        used = kept | (seen & ~adjusted.used & (excess < 1) & (left < _TIMES_LEFT_OUT))
        lone = (used.sum(axis=1, keepdims=True) == 1) & ((seen & ~used).sum(axis=1, keepdims=True) >= 2)
        doubtful |= lone
        used &= ~doubtful
        if (used == adjusted.used).all():
            wrong = lasting_errors(adjusted)
            if not wrong.any():
                wrong = deserted(adjusted.model.observed.times, seen, adjusted.used)
            if not wrong.any():
                return adjusted
            doubtful |= wrong
            used &= ~doubtful
        adjusted = settled(replace(adjusted, used=used), 2)
    return adjusted


def deserted(times: Floats, seen: Flags, used: Flags) -> Flags:
    """Which measurements are used although most of their camera's of the same thing around them had to go.

    What is taken for a marker beside it is so for a while. Such errors agree with each other, so that the motion gives
    way to the last of them when all others are gone.

    Args:
        times: (n,) s, of the pulses.
        seen: (n, m, 6) what was measured.
        used: (n, m, 6) what was not left out.
    """
    near = (np.abs(times[:, None] - times) <= _RUN_S).astype(float)
    gone = np.tensordot(near, (seen & ~used).astype(float), 1)
    left = np.tensordot(near, used.astype(float), 1)
    return np.asarray(used & (gone >= _RAYS_NO_CHANCE) & (gone > left))


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
    test = (v * np.linalg.solve(free, v[..., None])[..., 0]).sum(axis=-1)
    redundancy = np.where(adjusted.used, 2.0 - np.trace(spread, axis1=-2, axis2=-1), 0.0)
    return Statistics((v**2).sum(axis=-1), redundancy, test)


def _of_adjusted(adjusted: Adjusted) -> Floats:
    """Covariances (n, m, 6, 2, 2) of the adjusted observations, divided by those of the measurements."""
    solution, instants = adjusted.solution, adjusted.instants
    rows, border = adjusted.equations.by_channels, rows_by_shared(adjusted)
    n, m = adjusted.used.shape[:2]
    covariance = solution.covariance.reshape(n, 3, CHANNELS, 3, CHANNELS)
    cross = solution.cross.reshape(n, 3, CHANNELS, -1)
    spread = np.empty((n, m, len(GROUPS), 2, 2))
    for i, (at, own) in enumerate(zip(instants, border.swapaxes(0, 1), strict=True)):
        of_channels = np.tensordot(np.tensordot(covariance, at, (3, 0)), at, (1, 0)).swapaxes(1, 2)
        of_both = np.tensordot(cross, at, (1, 0)).swapaxes(1, 2)[:, None]
        back, own_back = rows[:, i].swapaxes(2, 3), own.swapaxes(2, 3)
        half = own @ (of_both @ back)
        spread[:, i] = rows[:, i] @ (of_channels[:, None] @ back) + own @ (solution.shared_covariance @ own_back)
        spread[:, i] += half + half.swapaxes(2, 3)
    return spread


def lasting_errors(adjusted: Adjusted) -> Flags:
    """Which measurements (n, m, 6) share an error, or may: of each time the worst ones, and their rivals.

    An error that lasts counts as gross if it is too large for a single measurement. Smaller ones are let be: errors of
    neighbouring images are never quite independent.
    """
    windows = _windows(adjusted)
    out = np.zeros_like(adjusted.used)
    if windows is None:
        return out
    tests = windows.tests(np.arange(len(windows.middle))[:, None])
    limit, rival = float(chdtri(2, FALSE_REMOVAL_P / len(tests))), float(chdtri(2, _RIVAL_P))
    for w in np.flatnonzero(tests > limit):
        near = np.flatnonzero(np.abs(windows.middle - windows.middle[w]) < LASTING_S)
        if tests[w] < tests[near].max():
            continue
        for other in near[tests[near] > tests[w] - rival]:
            if other == w or windows.tests(np.array([[w, other]]))[0] - tests[other] < rival:
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

    def tests(self, which: Integers) -> Floats:
        """Tests (t,) of windows (t, k) for an error that their measurements share.

        Chi-squared of two degrees of freedom for each of the k windows.
        """
        t, k = which.shape
        normal = self.normal[which[:, :, None], which[:, None]].swapaxes(2, 3).reshape(t, 2 * k, 2 * k)
        allowed = np.zeros((t, k, 2, k, 2))
        allowed[:, range(k), :, range(k)] = self.single[which].swapaxes(0, 1)
        pull = self.pull[which].reshape(t, 2 * k, 1)
        expected = normal + normal @ allowed.reshape(normal.shape) @ normal
        return np.asarray((pull * np.linalg.solve(expected, pull)).sum(axis=(1, 2)))


def _windows(adjusted: Adjusted) -> _Windows | None:
    """Eliminate all unknowns of the bundle from the normal equations of the windows' errors; None without windows."""
    observed, used = adjusted.model.observed, adjusted.used
    members = np.full(used.shape, -1)
    found = [
        run
        for i in range(used.shape[1])
        for g in range(used.shape[2])
        for run in runs(adjusted, i, g, LASTING_S)
        if len(run.pulses) > 1
    ]
    if not found:
        return None
    for w, run in enumerate(found):
        members[run.pulses, run.camera, run.group] = w
    count, sizes = len(found), np.array([len(run.pulses) for run in found])
    pulled = pulls(adjusted, found, [np.tile(np.eye(2), (size, 1, 1)) for size in sizes])
    spread = adjusted.solution.covariance_of(pulled.by_states, pulled.by_shared)
    normal = -spread.reshape(count, 2, count, 2).transpose(0, 2, 1, 3)
    normal[range(count), range(count)] += (1 + _FLOOR) * pulled.normal
    single = np.linalg.inv(pulled.normal) * sizes[:, None, None]
    middle = np.array([observed.times[run.pulses].mean() for run in found])
    return _Windows(members, middle, pulled.right, normal, single)
