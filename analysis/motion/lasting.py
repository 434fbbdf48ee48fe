"""Errors that last: what they do to a motion that was adjusted as if those of all images were independent.

What puts the axis of a ski off in an image, the other ski, a leg or a boot beside it, an edge in the light, a width
that is not quite known, puts it off alike in the next images of that camera; likewise what is beside a marker. More
pulses do not average such errors away. The weights of the adjustment stay as they are, so the motion does not change;
its covariance gains what errors do to it that fade by exp(-t / T) or stay for the whole jump (consider parameters:
Tapley, Schutz and Born 2004, chapter 6). With the normal equations N x = J' W l, an error e that the measurements of a
short run of pulses share moves the unknowns by N^-1 J' W e; in so short a time it hardly changes.

How large they are, the residuals tell: where cameras contradict each other alike in neighbouring pulses, something
lasts. So each camera has variances of its own for each thing, estimated together with what the images tell of
themselves (`lasting` of a ski).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.candidates.ski_fit import AXIS_PX
from analysis.measurements.model import POINTS
from analysis.motion.bundle import Adjusted, rows_by_shared
from analysis.motion.observations import GROUPS
from analysis.motion.prior import STATE
from rig.arrays import Floats, Integers

#: Errors last so long: an arm, a leg or the other ski is beside a thing for some tenths of a second.
LASTING_S: Final = 0.2
_RUN_S: Final = LASTING_S / 2  # in so short a time a lasting error is one number
_POINTS, _SKIS = range(len(POINTS)), range(len(POINTS), len(GROUPS))
#: Variances of lasting errors before a jump tells them: of points in those of single ones; of the axes of skis besides
#: `AXIS_PX` a factor for what their images tell. Half of each fades, half stays.
_OF_POINTS: Final = (0.01, 0.01)
_TOLD: Final = 1.0
_PSEUDO: Final = 1.0  # observations that they count as
_STEPS, _SETTLED = 12, 0.02  # of the iteration of variances, and the relative change that ends it
_RANK: Final = 1e-9  # of the greatest eigenvalue
_GAP_S, _GAP_PULSES = 0.05, 1.5  # behind a longer gap it may be another error


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Neighbouring pulses in which a camera measured a thing.

    Attributes:
        pulses: (k,) ascending.
        camera: its number.
        group: of GROUPS.
    """

    pulses: Integers
    camera: int
    group: int


def runs(adjusted: Adjusted, camera: int, group: int, longest_s: float) -> list[Run]:
    """The measurements that take part, as runs without long gaps, none longer than a given time."""
    times = adjusted.model.observed.times
    gap = max(_GAP_S, _GAP_PULSES * adjusted.model.prior.unit)
    found: list[list[int]] = []
    for k in np.flatnonzero(adjusted.used[:, camera, group]).tolist():
        if found and times[k] - times[found[-1][-1]] < gap and times[k] - times[found[-1][0]] < longest_s:
            found[-1].append(k)
        else:
            found.append([k])
    return [Run(np.array(run), camera, group) for run in found]


def pulls(adjusted: Adjusted, found: list[Run], errors: list[Floats]) -> tuple[Floats, Floats]:
    """Right-hand sides J' W e of the normal equations: by states (n, 48, w, f) and by shared unknowns (b, w, f).

    Args:
        adjusted: the bundle.
        found: w runs.
        errors: of each run (k, 2, f): both observations of each pulse (rows) by f errors (columns), px.
    """
    shared = rows_by_shared(adjusted)
    f = errors[0].shape[-1] if errors else 0
    by_states = np.zeros((len(adjusted.used), STATE, len(found), f))
    by_shared = np.zeros((shared.shape[-1], len(found), f))
    for w, (run, error) in enumerate(zip(found, errors, strict=True)):
        at = run.pulses, run.camera, run.group
        white = adjusted.model.observed.whitener[at] @ error
        rows = np.einsum("pac,pab->pcb", adjusted.equations.by_channels[at], white)
        by_states[run.pulses, :, w] = np.einsum("d,pcb->pdcb", adjusted.instants[run.camera], rows).reshape(
            -1, STATE, f
        )
        by_shared[:, w] = np.einsum("pas,pab->sb", shared[at], white)
    return by_states, by_shared


def lasting_covariance(adjusted: Adjusted, square: Floats, redundancy: Floats) -> Floats:
    """What errors that last add to the covariances of the states (n, 48, 48).

    Args:
        adjusted: the bundle.
        square: (n, m, 6) weighted square sums of the residuals of its groups.
        redundancy: (n, m, 6) their shares in the degrees of freedom.
    """
    total = np.zeros((len(adjusted.used), STATE, STATE))
    shift, turn = AXIS_PX**2 * adjusted.model.observed.factors[_SKIS.start] ** 2
    for things, start in ((_POINTS, _OF_POINTS), (_SKIS, (shift, turn, _TOLD))):
        series = [
            own
            for camera in range(adjusted.used.shape[1])
            for group in things
            if (own := runs(adjusted, camera, group, _RUN_S))
        ]
        if series:
            used = adjusted.used[:, :, things.start : things.stop]
            fit = (float(part[:, :, things.start : things.stop][used].sum()) for part in (square, redundancy))
            total += _effect(adjusted, series, np.tile(start, (2, 1)) / 2, *fit)
    return total


def _effect(adjusted: Adjusted, series: list[list[Run]], start: Floats, square: float, redundancy: float) -> Floats:
    """What the errors of s series of runs add to the covariances of the states (n, 48, 48).

    Args:
        adjusted: the bundle.
        series: of one camera and one thing each.
        start: (2, f) variances of the f errors of a run before anything is known: of what fades, and of what stays.
        square: weighted square sum of the residuals of all series.
        redundancy: their degrees of freedom.
    """
    found = [run for own in series for run in own]
    errors = [error for own in series for error in _shapes(adjusted, own)]
    by_states, by_shared = (part.reshape(*part.shape[:-2], -1) for part in pulls(adjusted, found, errors))
    normal = -adjusted.solution.covariance_of(by_states, by_shared)
    f = start.shape[-1]
    pull = np.empty((len(found), f))
    for w, (run, error) in enumerate(zip(found, errors, strict=True)):
        at, own = (run.pulses, run.camera, run.group), slice(w * f, (w + 1) * f)
        white = adjusted.model.observed.whitener[at] @ error
        normal[own, own] += np.einsum("pab,pac->bc", white, white)
        pull[w] = np.einsum("pab,pa->b", white, adjusted.equations.v[at])
    alike = [_alike(adjusted, own) for own in series]
    variances = _variances(_Residuals.of(normal, pull.ravel(), square, redundancy), alike, start)
    moved = adjusted.solution.moved_by(by_states, by_shared)
    total = np.zeros((len(moved), STATE, STATE))
    first = 0
    for correlation, variance in zip(alike, variances, strict=True):
        covariance = _covariance(correlation, variance)
        part = moved[:, :, first : first + len(covariance)]
        total += (part @ covariance) @ part.transpose(0, 2, 1)
        first += len(covariance)
    return total


def _alike(adjusted: Adjusted, own: list[Run]) -> Floats:
    """Correlations (2, w, w) of the lasting errors of w runs: of what fades, and of what stays."""
    middle = np.array([adjusted.model.observed.times[run.pulses].mean() for run in own])
    fading = np.exp(-np.abs(middle[:, None] - middle) / LASTING_S)
    return np.stack((fading, np.ones_like(fading)))


def _covariance(alike: Floats, variance: Floats) -> Floats:
    """(w f, w f) of the errors of w runs with variances (2, f), run by run."""
    w, f = alike.shape[-1], variance.shape[-1]
    return np.asarray(np.einsum("kvw,ke,ef->vewf", alike, variance, np.eye(f)).reshape(w * f, w * f))


@dataclass(frozen=True, slots=True, eq=False)
class _Residuals:
    """What the residuals v say about lasting errors e of r runs in all.

    Attributes:
        normal: (r f, r f) N = E' W Qv W E, the normal equations of e when all other unknowns are eliminated.
        pull: (r f,) E' W v, their right-hand side p.
        errors: (r f,) e, if nothing but the residuals is known.
        rank: of N.
        square: v' W v - p' e, what lasting errors have no part in.
        redundancy: of it.
    """

    normal: Floats
    pull: Floats
    errors: Floats
    rank: int
    square: float
    redundancy: float

    @classmethod
    def of(cls, normal: Floats, pull: Floats, square: float, redundancy: float) -> "_Residuals":
        """From v' W v and the redundancy of all residuals."""
        values, vectors = np.linalg.eigh(normal)
        use = values > _RANK * values[-1]
        vectors = vectors[:, use]
        errors = vectors @ ((vectors.T @ pull) / values[use])
        rank = int(use.sum())
        inside = max(square - float(pull @ errors), 0.0), max(redundancy - rank, 0.0)
        return cls(normal, pull, errors, rank, *inside)


def _variances(residuals: _Residuals, alike: list[Floats], start: Floats) -> Floats:
    """Variances (s, 2, f) of the errors of each series: restricted maximum likelihood with a prior.

    If independent errors have q times the variances that the weights say, and lasting ones B, variances times
    correlations C, the right-hand sides p have the covariance V = q N + N B N. Each variance gets its square sum over
    its redundancy: with g = N V^-1 p and G = N V^-1 N, s becomes s (g' C g) / tr(C G), and likewise q, of which the
    rest of the residuals knows, too. All series together come first, with `start` as one observation; then each for
    itself, with what all say as one observation.
    """
    pooled, independent = start, 1.0
    variances = np.tile(start, (len(alike), 1, 1))
    for alone in (False, True):
        for _ in range(_STEPS):
            before = variances
            square, redundancy, independent = _squares(residuals, alike, variances, independent)
            if alone:
                variances = (square + _PSEUDO * pooled) / (redundancy + _PSEUDO)
            else:
                pooled = (square.sum(axis=0) + _PSEUDO * start) / (redundancy.sum(axis=0) + _PSEUDO)
                variances = np.tile(pooled, (len(alike), 1, 1))
            if np.allclose(variances, before, rtol=_SETTLED, atol=0.0):
                break
    return variances


def _squares(
    residuals: _Residuals, alike: list[Floats], variances: Floats, independent: float
) -> tuple[Floats, Floats, float]:
    """Square sums (s, 2, f) times the squares of the variances, redundancies times the variances, and a better q."""
    f, normal = variances.shape[-1], residuals.normal
    by_lasting = np.empty_like(normal)
    first = 0
    for correlation, variance in zip(alike, variances, strict=True):
        own = slice(first, first := first + f * correlation.shape[-1])
        by_lasting[:, own] = normal[:, own] @ _covariance(correlation, variance)
    together = independent * np.eye(len(normal)) + by_lasting
    inverse = np.linalg.inv(together)
    pulled, weights = inverse @ residuals.pull, inverse @ normal
    unbent = float(inverse.T @ residuals.errors @ pulled)
    free = independent * float(np.trace(inverse)) - (len(normal) - residuals.rank)
    better = (residuals.square + independent**2 * unbent + _PSEUDO) / (residuals.redundancy + free + _PSEUDO)
    square, redundancy = np.empty_like(variances), np.empty_like(variances)
    first = 0
    for i, correlation in enumerate(alike):
        w = correlation.shape[-1]
        own = slice(first, first := first + f * w)
        g, weight = pulled[own].reshape(w, f), weights[own, own].reshape(w, f, w, f)
        square[i] = np.einsum("kvw,ve,we->ke", correlation, g, g)
        redundancy[i] = np.einsum("kvw,vewe->ke", correlation, weight)
    return square * variances**2, redundancy * variances, better


def _shapes(adjusted: Adjusted, own: list[Run]) -> list[Floats]:
    """Errors of the measurements of each run of one camera and one thing.

    Of a point (k, 2, 2) two as large as its sigmas; of a ski (k, 2, 3) a shift and a turn of a px, and a shift as large
    as its images tell.
    """
    observed, camera, group = adjusted.model.observed, own[0].camera, own[0].group
    if group in _POINTS:
        return [np.linalg.inv(observed.whitener[run.pulses, camera, group]) for run in own]
    pulses = np.concatenate([run.pulses for run in own])
    turn, told = _same_way(observed.xy[pulses, camera, group]), observed.lasting[pulses, camera, group]
    shift = np.ones_like(turn)
    shapes = np.stack((np.stack((shift, -turn, told), axis=-1), np.stack((shift, turn, told), axis=-1)), axis=1)
    return np.split(shapes, np.cumsum([len(run.pulses) for run in own])[:-1])


def _same_way(xy: Floats) -> Floats:
    """1 or -1 (k,): which of its two points (k, 2, 2) a ski's image has first is chance; turns need the same one."""
    along = xy[:, 1] - xy[:, 0]
    same = (along[1:] * along[:-1]).sum(axis=1)
    return np.asarray(np.cumprod(np.concatenate(([1.0], np.where(same < 0, -1.0, 1.0)))))
