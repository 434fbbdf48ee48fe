"""The bundle over time: one least-squares adjustment of all measurements of a jump.

Unknowns are the state of sixteen channels at each pulse, and, shared by all pulses, the uncertain parameters of the
cameras and how much later each camera shows the scene than it says. The cameras' parameters enter as c0 + L u with
c0 and L L' the given ones and u of weight 1; so a rank defect of their covariance does no harm. Gauss-Newton on normal
equations that are block-tridiagonal with a border (`blocks`).
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.motion.adjustment.blocks import Normals, Solution, solve
from analysis.motion.model.channels import CHANNELS, MotionFrame
from analysis.motion.model.equations import Equations, linearised
from analysis.motion.model.observations import Observations
from analysis.motion.model.prior import STATE, Prior, transitions
from analysis.scene.camera_arrays import CameraArrays
from rig.arrays import Flags, Floats

_RANK: Final = 1e-12  # of the greatest eigenvalue of the scaled covariance
_COMMON_SIGMA: Final = 1e-4  # pulse intervals, of the mean lateness where it is given by definition
_SETTLED: Final = 0.01  # of a sigma: greatest step of O that ends the iteration
_FAR_FACTOR: Final = 10.0  # times the median distance from approximate states
MEDIAN: Final = float(chdtri(2, 0.5))  #: of the weighted square sum of a group


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """What is given to the adjustment.

    Attributes:
        observed: the measurements.
        cameras: as they were oriented.
        root: (p, r) L, a root of the covariance of all cameras' parameters.
        own_root: (m, 16, r) its rows that belong to each camera, see `own_root`.
        frame: of the motion.
        prior: of the motion.
        late: (m,) expected lateness of the cameras, in pulse intervals.
        late_sigma: (m,) its standard deviation.
        clock_is_mean: whether the mean lateness of all cameras is as expected by definition: no camera's is known.
    """

    observed: Observations
    cameras: CameraArrays
    root: Floats
    own_root: Floats
    frame: MotionFrame
    prior: Prior
    late: Floats
    late_sigma: Floats
    clock_is_mean: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Adjusted:
    """The state of an adjustment.

    Attributes:
        model: what was given.
        used: (n, m, 6) groups that take part.
        states: (n, 48), see `prior`.
        shared: (r + m,) u, then the lateness of each camera in pulse intervals.
        equations: at the point of the last linearisation.
        solution: of the last step, with the covariances; None before the first.
        step: length of the last step of O in its sigmas.
    """

    model: Model
    used: Flags
    states: Floats
    shared: Floats
    equations: Equations
    solution: Solution
    step: float = np.inf

    @property
    def late(self) -> Floats:
        """(m,) in pulse intervals."""
        return self.shared[self.model.root.shape[1] :]

    @property
    def instants(self) -> Floats:
        """(m, 3): what value, speed and acceleration of a state contribute at each camera's own time."""
        return _instants(self.model, self.shared)


def root_of(covariance: Floats) -> Floats:
    """L (p, r) with L L' the covariance, r its rank."""
    scale = np.sqrt(np.maximum(np.diagonal(covariance), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    use = values > _RANK * max(float(values.max(initial=0.0)), 1.0)
    return np.asarray(scale[:, None] * vectors[:, use] * np.sqrt(values[use]))


def begun(model: Model, states: Floats, used: Flags, shared: Floats) -> Adjusted:
    """The first step of an adjustment from approximate states (n, 48) and shared unknowns (r + m,)."""
    return _stepped(model, used, states, shared)


def near(model: Model, states: Floats, shared: Floats) -> Flags:
    """Which groups (n, m, 6) are about as near to approximate states as most of their kind are.

    An adjustment cannot begin with gross errors: they would turn the cameras. Measurements that were left out without
        need come back later (`without_gross_errors`).
    """
    channels = np.einsum("id,ndc->nic", _instants(model, shared), states.reshape(len(states), 3, CHANNELS))
    v = _linearised(model, shared, channels).v
    seen, square = model.observed.seen, (v**2).sum(axis=-1)
    usual = np.array([np.median(square[:, :, g][seen[:, :, g]]) if seen[:, :, g].any() else 0.0 for g in range(6)])
    return np.asarray(seen & (square <= _FAR_FACTOR**2 * np.maximum(usual, MEDIAN)))


def settled(adjusted: Adjusted, most: int) -> Adjusted:
    """Gauss-Newton steps until they are small, at most so many."""
    for _ in range(most):
        adjusted = _stepped(adjusted.model, adjusted.used, adjusted.states, adjusted.shared)
        if adjusted.step < _SETTLED:
            break
    return adjusted


def with_prior(adjusted: Adjusted, prior: Prior) -> Adjusted:
    """One step with another prior of the motion."""
    return _stepped(replace(adjusted.model, prior=prior), adjusted.used, adjusted.states, adjusted.shared)


def rows_by_shared(adjusted: Adjusted) -> Floats:
    """Derivatives (n, m, 6, 2, r + m) of the observations by the shared unknowns."""
    return _rows_by_shared(adjusted.model, adjusted.equations, adjusted.states, adjusted.instants)


def _linearised(model: Model, shared: Floats, channels: Floats) -> Equations:
    cameras = model.cameras.moved(model.own_root @ shared[: model.root.shape[1]])
    return linearised(model.observed, cameras, model.own_root, model.frame, channels)


def _instants(model: Model, shared: Floats) -> Floats:
    late = shared[model.root.shape[1] :] + model.observed.delay / model.prior.unit
    return np.asarray(transitions(late)[:, 0])


def _rows_by_shared(model: Model, equations: Equations, states: Floats, instants: Floats) -> Floats:
    n, m = model.observed.shape
    x = states.reshape(n, 3, CHANNELS)
    rank = model.root.shape[1]
    out = np.zeros((n, m, 6, 2, rank + m))
    out[..., :rank] = equations.by_u
    for i in range(m):
        speed = x[:, 1] + 2 * instants[i, 1] * x[:, 2]
        out[:, i, :, :, rank + i] = (equations.by_channels[:, i].reshape(n, 12, -1) @ speed[..., None]).reshape(n, 6, 2)
    return out


def _stepped(model: Model, used: Flags, states: Floats, shared: Floats) -> Adjusted:
    """Linearise and solve once."""
    n, _ = model.observed.shape
    instants = _instants(model, shared)
    channels = np.einsum("id,ndc->nic", instants, states.reshape(n, 3, CHANNELS))
    equations = _linearised(model, shared, channels)
    normals = _normals(model, used, states, shared, equations, instants)
    solution = solve(normals)
    sigma = np.sqrt(np.diagonal(solution.covariance[:, :3, :3], axis1=1, axis2=2))
    step = float(np.abs(solution.states[:, :3] / sigma).max())
    states, shared = states + solution.states, shared + solution.shared
    equations = replace(equations, v=_predicted(model, equations, solution, instants, states))
    return Adjusted(model, used, states, shared, equations, solution, step)


def _predicted(model: Model, equations: Equations, solution: Solution, instants: Floats, states: Floats) -> Floats:
    """Residuals after the step, by the linearised equations."""
    n = len(states)
    change = np.einsum("id,ndc->nic", instants, solution.states.reshape(n, 3, CHANNELS))
    rows = _rows_by_shared(model, equations, states, instants)
    moved = (equations.by_channels @ change[:, :, None, :, None])[..., 0] + rows @ solution.shared
    return np.asarray(equations.v + moved)


def _normals(
    model: Model, used: Flags, states: Floats, shared: Floats, equations: Equations, instants: Floats
) -> Normals:
    n, m = model.observed.shape
    take = used[..., None, None]
    rows = np.where(take, equations.by_channels, 0.0).reshape(n, m, 12, CHANNELS)
    by_shared = np.where(take, _rows_by_shared(model, equations, states, instants), 0.0).reshape(n, m, 12, -1)
    v = np.where(used[..., None], equations.v, 0.0).reshape(n, m, 12, 1)
    back = rows.swapaxes(2, 3)
    both = np.einsum("id,ie->dei", instants, instants).reshape(-1, m)
    blocks = (both @ (back @ rows).reshape(n, m, -1)).reshape(n, 3, 3, CHANNELS, CHANNELS)
    diagonal = blocks.swapaxes(2, 3).reshape(n, STATE, STATE)
    by_time = (instants.T @ (back @ np.concatenate((by_shared, v), axis=3)).reshape(n, m, -1)).reshape(n, STATE, -1)
    border, right = by_time[..., :-1], -by_time[..., -1]
    flat = by_shared.reshape(n * m * 12, -1)
    corner, right_corner = flat.T @ flat, -flat.T @ v.ravel()
    lower = _add_motion(model.prior, states, diagonal, right)
    _add_shared(model, shared, corner, right_corner)
    return Normals(diagonal, lower, border, corner, right, right_corner)


def _add_motion(prior: Prior, states: Floats, diagonal: Floats, right: Floats) -> Floats:
    """Add the prior of the motion to diagonal and right-hand side; returns the blocks below the diagonal."""
    n = len(states)
    x = states.reshape(n, 3, CHANNELS).transpose(0, 2, 1)
    move = prior.transition[:, None]
    weight = np.asarray(np.linalg.inv(prior.noise()), float)
    pull = np.einsum(
        "kcij,kcj->kci", weight, x[1:] - np.einsum("kcij,kcj->kci", np.broadcast_to(move, weight.shape), x[:-1])
    )
    diagonal[1:] += _embedded(weight)
    diagonal[:-1] += _embedded(move.swapaxes(-1, -2) @ weight @ move)
    right[1:] -= pull.transpose(0, 2, 1).reshape(n - 1, STATE)
    right[:-1] += np.einsum("kji,kcj->kic", prior.transition, pull).reshape(n - 1, STATE)
    mean, start_weight = prior.start()
    diagonal[0] += np.diag(start_weight)
    right[0] -= start_weight * (states[0] - mean)
    body = prior.body()
    diagonal[1:] += np.diag(body)
    right[1:] -= body * (states[1:] - mean)
    return _embedded(-weight @ move)


def _embedded(blocks: Floats) -> Floats:
    """(n, 48, 48) from blocks (n, 16, 3, 3) of single channels."""
    n = len(blocks)
    out = np.zeros((n, 3, CHANNELS, 3, CHANNELS))
    channel = np.arange(CHANNELS)
    out[:, :, channel, :, channel] = blocks.transpose(1, 0, 2, 3)
    return out.reshape(n, STATE, STATE)


def _add_shared(model: Model, shared: Floats, corner: Floats, right: Floats) -> None:
    """Add what is known of the shared unknowns: u, the lateness of each camera, and the mean that is the clock."""
    rank = model.root.shape[1]
    off = shared[rank:] - model.late
    weight = np.diag(model.late_sigma**-2.0)
    if model.clock_is_mean:
        weight = weight + _COMMON_SIGMA**-2.0 / len(off) ** 2
    corner[:rank, :rank] += np.eye(rank)
    corner[rank:, rank:] += weight
    right[:rank] -= shared[:rank]
    right[rank:] -= weight @ off
