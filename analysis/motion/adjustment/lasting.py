"""The effect of lasting errors on a motion that was adjusted as if the errors of all images were independent.

What puts the axis of a ski off in an image, the other ski, a leg or a boot beside it, an edge in the light, a width
that is not quite known, puts it off alike in the next images of that camera; likewise what is beside a marker. More
pulses do not average such errors away. The weights of the adjustment stay as they are, so the motion does not change;
its covariance, and that of how late the cameras are, gain the effect of errors that fade by exp(-t / T) or stay for the
whole jump (consider parameters: Tapley, Schutz and Born 2004, chapter 6). With the normal equations N x = J' W l, an
error e that the measurements of a short run of pulses share moves the unknowns by N^-1 J' W e; in so short a time it
hardly changes.

How large they are, the residuals tell: where cameras contradict each other alike in neighbouring pulses, something
lasts. So each camera has variances of its own for each thing, estimated together with what the images tell of
themselves (`lasting` of a ski).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.measurements.model import POINTS
from analysis.motion.adjustment.bundle import Adjusted, rows_by_shared
from analysis.motion.adjustment.lasting_variances import Residuals, covariance_of, variances_of
from analysis.motion.model.observations import GROUPS
from analysis.motion.model.prior import STATE
from rig.arrays import Floats, Integers

#: Errors last so long: an arm, a leg or the other ski is beside a thing for some tenths of a second.
LASTING_S: Final = 0.2
_RUN_S: Final = LASTING_S / 2  # in so short a time a lasting error is one number
_POINTS, _SKIS = range(len(POINTS)), range(len(POINTS), len(GROUPS))
#: Variances of lasting errors before a jump tells them: of points in those of single ones; of the axes of skis besides
#: `_AXIS_PX` a factor for what their images tell. Half of each fades, half stays.
_OF_POINTS: Final = (0.01, 0.01)
_TOLD: Final = 1.0
#: Standard deviation of the axis of a ski in an image, px, which its images never tell.
_AXIS_PX: Final = 0.015
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


@dataclass(frozen=True, slots=True, eq=False)
class Pulls:
    """What errors that the measurements of w runs share, f each, do in the normal equations.

    Attributes:
        by_states: (n, 48, w f) J' W e of the states.
        by_shared: (b, w f) of the shared unknowns.
        normal: (w, f, f) E' W E of the errors of each run.
        right: (w, f) E' W v.
    """

    by_states: Floats
    by_shared: Floats
    normal: Floats
    right: Floats


def pulls(adjusted: Adjusted, found: list[Run], errors: list[Floats]) -> Pulls:
    """What errors do in the normal equations.

    Args:
        adjusted: the bundle.
        found: w runs, one at least.
        errors: of each run (k, 2, f): both observations of each pulse (rows) by f errors (columns), px.
    """
    n, w, f = len(adjusted.used), len(found), errors[0].shape[-1]
    size = np.array([len(run.pulses) for run in found])
    number, first = np.repeat(np.arange(w), size), np.cumsum(size) - size
    pulse = np.concatenate([run.pulses for run in found])
    camera, group = np.array([(run.camera, run.group) for run in found])[number].T
    at = pulse, camera, group
    white = adjusted.model.observed.whitener[at] @ np.concatenate(errors)
    back = white.swapaxes(1, 2)
    rows = adjusted.equations.by_channels[at].swapaxes(1, 2) @ white
    by_states = np.zeros((n, STATE, w, f))
    by_states[pulse, :, number] = (adjusted.instants[camera][:, :, None, None] * rows[:, None]).reshape(-1, STATE, f)
    by_shared = np.add.reduceat(rows_by_shared(adjusted)[at].swapaxes(1, 2) @ white, first)
    right = np.add.reduceat((back @ adjusted.equations.v[at][..., None])[..., 0], first)
    return Pulls(
        by_states.reshape(n, STATE, -1),
        by_shared.swapaxes(0, 1).reshape(-1, w * f),
        np.add.reduceat(back @ white, first),
        right,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Added:
    """What errors that last add to covariances.

    Attributes:
        states: (n, 48, 48) of each state.
        shared: (b, b) of the shared unknowns.
    """

    states: Floats
    shared: Floats


def lasting_covariance(adjusted: Adjusted, square: Floats, redundancy: Floats) -> Added:
    """What errors that last add to the covariances of a bundle.

    Args:
        adjusted: the bundle.
        square: (n, m, 6) weighted square sums of the residuals of its groups.
        redundancy: (n, m, 6) their shares in the degrees of freedom.
    """
    b = len(adjusted.shared)
    total = Added(np.zeros((len(adjusted.used), STATE, STATE)), np.zeros((b, b)))
    shift, turn = _AXIS_PX**2 * adjusted.model.observed.factors[_SKIS.start] ** 2
    for things, start in ((_POINTS, _OF_POINTS), (_SKIS, (shift, turn, _TOLD, _TOLD))):
        series = [
            own
            for camera in range(adjusted.used.shape[1])
            for group in things
            if (own := runs(adjusted, camera, group, _RUN_S))
        ]
        if series:
            used = adjusted.used[:, :, things.start : things.stop]
            fit = (float(part[:, :, things.start : things.stop][used].sum()) for part in (square, redundancy))
            _add_effect(total, adjusted, series, np.tile(start, (2, 1)) / 2, *fit)
    return total


def _add_effect(
    total: Added, adjusted: Adjusted, series: list[list[Run]], start: Floats, square: float, redundancy: float
) -> None:
    """Add what the errors of s series of runs do, in place.

    Args:
        total: to which it is added.
        adjusted: the bundle.
        series: of one camera and one thing each.
        start: (2, f) variances of the f errors of a run before anything is known: of what fades, and of what stays.
        square: weighted square sum of the residuals of all series.
        redundancy: their degrees of freedom.
    """
    found = [run for own in series for run in own]
    errors = [error for own in series for error in _shapes(adjusted, own)]
    pulled = pulls(adjusted, found, errors)
    moved, shared, spread = adjusted.solution.effects_of(pulled.by_states, pulled.by_shared)
    w, f = pulled.right.shape
    normal = -spread
    normal.reshape(w, f, w, f)[range(w), :, range(w)] += pulled.normal
    alike = [_alike(adjusted, own) for own in series]
    variances = variances_of(Residuals.of(normal, pulled.right.ravel(), square, redundancy), alike, start)
    first = 0
    for correlation, variance in zip(alike, variances, strict=True):
        covariance = covariance_of(correlation, variance)
        own = slice(first, first + len(covariance))
        total.states[:] += (moved[:, :, own] @ covariance) @ moved[:, :, own].transpose(0, 2, 1)
        total.shared[:] += shared[:, own] @ covariance @ shared[:, own].T
        first = own.stop


def _alike(adjusted: Adjusted, own: list[Run]) -> Floats:
    """Correlations (2, w, w) of the lasting errors of w runs: of the fading part, and of the constant one."""
    middle = np.array([adjusted.model.observed.times[run.pulses].mean() for run in own])
    fading = np.exp(-np.abs(middle[:, None] - middle) / LASTING_S)
    return np.stack((fading, np.ones_like(fading)))


def _shapes(adjusted: Adjusted, own: list[Run]) -> list[Floats]:
    """Errors of the measurements of each run of one camera and one thing.

    Of a point (k, 2, 2) two as large as its sigmas; of a ski (k, 2, 4) a shift and a turn of a px, and both as large
    as its images tell.
    """
    observed, camera, group = adjusted.model.observed, own[0].camera, own[0].group
    if group in _POINTS:
        return [np.linalg.inv(observed.whitener[run.pulses, camera, group]) for run in own]
    pulses = np.concatenate([run.pulses for run in own])
    turn, told = _same_way(observed.xy[pulses, camera, group]), observed.lasting[pulses, camera, group]
    shift = np.ones_like(turn)
    before, behind = (np.stack((shift, way * turn, told, way * turn * told), axis=-1) for way in (-1, 1))
    shapes = np.stack((before, behind), axis=1)
    return np.split(shapes, np.cumsum([len(run.pulses) for run in own])[:-1])


def _same_way(xy: Floats) -> Floats:
    """1 or -1 (k,): which of its two points (k, 2, 2) a ski's image has first is chance; turns need the same one."""
    along = xy[:, 1] - xy[:, 0]
    same = (along[1:] * along[:-1]).sum(axis=1)
    return np.asarray(np.cumprod(np.concatenate(([1.0], np.where(same < 0, -1.0, 1.0)))))
