"""Errors that last: what they do to a motion that was adjusted as if those of all images were independent.

What puts the axis of a ski off in an image, the other ski, a leg or a boot beside it, its bend, a width that is not
quite known, puts it off alike in the next images of that camera. More pulses do not average such errors away. The
weights of the adjustment stay as they are, so the motion does not change; its covariance gains what errors with a
correlation of exp(-t / T) do to it (consider parameters: Tapley, Schutz and Born 2004, chapter 6). With the normal
equations N x = J' W l, an error e that the measurements of a short run of pulses share moves the unknowns by
N^-1 J' W e; in so short a time it hardly changes. How large they are, an image tells where it is known (`lasting`);
what lasts beyond that is told by the residuals themselves, which are alike in neighbouring pulses.
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
_SKIS: Final = range(len(POINTS), len(GROUPS))
_FEWEST: Final = 10  # controlled pairs of neighbouring images that tell what lasts in them
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
    """Right-hand sides J' W e of the normal equations: by states (n, 48, w, 2) and by shared unknowns (b, w, 2).

    Args:
        adjusted: the bundle.
        found: w runs.
        errors: of each run (k, 2, 2): both observations of each pulse (rows) by two errors (columns), px.
    """
    shared = rows_by_shared(adjusted)
    by_states = np.zeros((len(adjusted.used), STATE, len(found), 2))
    by_shared = np.zeros((shared.shape[-1], len(found), 2))
    for w, (run, error) in enumerate(zip(found, errors, strict=True)):
        at = run.pulses, run.camera, run.group
        white = adjusted.model.observed.whitener[at] @ error
        rows = np.einsum("pac,pab->pcb", adjusted.equations.by_channels[at], white)
        by_states[run.pulses, :, w] = np.einsum("d,pcb->pdcb", adjusted.instants[run.camera], rows).reshape(
            -1, STATE, 2
        )
        by_shared[:, w] = np.einsum("pas,pab->sb", shared[at], white)
    return by_states, by_shared


def lasting_covariance(adjusted: Adjusted) -> Floats:
    """What errors that last add to the covariances of the states (n, 48, 48)."""
    observed = adjusted.model.observed
    variance = _neighbours(adjusted)
    series = [
        (own, _shapes(adjusted, own, variance))
        for camera in range(observed.shape[1])
        for group in _SKIS
        if (own := runs(adjusted, camera, group, _RUN_S))
    ]
    total = np.zeros((len(adjusted.used), STATE, STATE))
    if not series:
        return total
    found, errors = [run for own, _ in series for run in own], [e for _, shapes in series for e in shapes]
    by_states, by_shared = pulls(adjusted, found, errors)
    moved = adjusted.solution.moved_by(
        by_states.reshape(len(by_states), STATE, -1), by_shared.reshape(len(by_shared), -1)
    ).reshape(by_states.shape)
    first = 0
    for own, _ in series:
        middle = np.array([observed.times[run.pulses].mean() for run in own])
        alike = np.exp(-np.abs(middle[:, None] - middle) / LASTING_S)
        part = moved[:, :, first : first + len(own)]
        spread = np.einsum("nswe,wv->nsve", part, alike).reshape(*total.shape[:2], -1)
        total += spread @ part.reshape(spread.shape).transpose(0, 2, 1)
        first += len(own)
    return total


def _shapes(adjusted: Adjusted, own: list[Run], variance: float) -> list[Floats]:
    """A shift and a turn (k, 2, 2) of the measurements of each run, one standard deviation large, px.

    Args:
        adjusted: the bundle.
        own: runs of one camera and one ski.
        variance: px^2, of the shift and of the turn of every image.
    """
    observed, camera, group = adjusted.model.observed, own[0].camera, own[0].group
    pulses = np.concatenate([run.pulses for run in own])
    shift = np.hypot(observed.lasting[pulses, camera, group], np.sqrt(variance))
    turn = _same_way(observed.xy[pulses, camera, group]) * np.sqrt(variance)
    shapes = np.stack((np.stack((shift, -turn), axis=-1), np.stack((shift, turn), axis=-1)), axis=1)
    return np.split(shapes, np.cumsum([len(run.pulses) for run in own])[:-1])


def _same_way(xy: Floats) -> Floats:
    """1 or -1 (k,): which of its two points (k, 2, 2) a ski's image has first is chance; turns need the same one."""
    along = xy[:, 1] - xy[:, 0]
    same = (along[1:] * along[:-1]).sum(axis=1)
    return np.asarray(np.cumprod(np.concatenate(([1.0], np.where(same < 0, -1.0, 1.0)))))


def _neighbours(adjusted: Adjusted) -> float:
    """Variance of what lasts in every image of a ski, px^2: of its shift, and of its turn.

    Independent residuals of neighbouring pulses have products of mean 0; what lasts is in both. A ski in m images has
    2 m observations for the 4 parameters of a line, and only that share of an error is left in the residuals.
    """
    observed, used = adjusted.model.observed, adjusted.used
    products: list[Floats] = []
    shares: list[Floats] = []
    for camera in range(observed.shape[1]):
        for group in _SKIS:
            pulses = np.flatnonzero(used[:, camera, group])
            white, v = observed.whitener[pulses, camera, group], adjusted.equations.v[pulses, camera, group]
            off = np.linalg.solve(white, v[..., None])[..., 0]
            turn = (off[:, 1] - off[:, 0]) / 2 * _same_way(observed.xy[pulses, camera, group])
            errors = np.stack((off.mean(axis=1), turn), axis=-1)
            cameras = used[pulses, :, group].sum(axis=1)
            usual = observed.lasting[pulses, camera, group] <= np.abs(1 / white[:, 0, 0])
            for lag in range(1, len(pulses)):
                near = observed.times[pulses[lag:]] - observed.times[pulses[:-lag]] < _RUN_S
                if not near.any():
                    break
                pair = near & usual[lag:] & usual[:-lag]
                products.append((errors[lag:] * errors[:-lag])[pair])
                shares.append(np.maximum(0.0, 1 - 2 / np.minimum(cameras[lag:], cameras[:-lag]))[pair])
    share = float(np.concatenate(shares).sum()) if shares else 0.0
    if share < _FEWEST:
        return AXIS_PX**2
    return max(0.0, float(np.concatenate(products).sum())) / (2 * share)
