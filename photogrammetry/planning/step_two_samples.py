"""Step 2 of many samples at a time: each with its own errors of all observations, and its own optimum.

Gauss-Newton. A point that no distance or difference ties to others is eliminated (Schur complement). Where a camera
parameter is weak (decentring beside the principal point) Gauss-Newton overshoots by a nearly constant factor; two steps
in a row tell that factor, and the next one goes where they would end (Anderson's extrapolation, one step deep).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from photogrammetry.adjustment.adjustment import Adjustment
from photogrammetry.adjustment.datum import datum_points, inner_operator
from photogrammetry.adjustment.problem import Problem
from photogrammetry.adjustment.state import State
from photogrammetry.adjustment.unknowns import Integers
from photogrammetry.camera_model import Lens, linearise
from photogrammetry.diagnosis import NotConvergedError
from photogrammetry.planning.relation_samples import Normals, add_relations
from photogrammetry.rotation import rotation_from_vector

Floats = NDArray[np.float64]

_CHUNK_NUMBERS = 400_000  # of derivatives at a time: they stay in the cache
_STEPS = 200  # few samples need many, and those alone go on
_ENOUGH = 1e-3  # of a sigma; the scatter of 4000 samples is only known to 1e-2


@dataclass(frozen=True, slots=True, eq=False)
class _Observed:
    """What samples have observed: xy (samples, n, 2); whitened errors of the other observations (samples, m)."""

    xy: Floats
    errors: Floats

    def taken(self, which: Integers) -> "_Observed":
        return _Observed(self.xy[which], self.errors[which])


class StepTwo:
    """Step 2 of a plan, ready to be repeated.

    Args:
        adjusted: the error-free adjustment.
    """

    def __init__(self, adjusted: Adjustment) -> None:
        self.problem: Problem = adjusted.problem
        self.truth = adjusted.state
        self.sigma = np.sqrt(np.diagonal(adjusted.cofactors))
        problem, unknowns = self.problem, self.problem.unknowns
        points = datum_points(adjusted.network)
        #: free motions (u, d) and the conditions (d, u) of the datum that stop them
        self.moves, self.conditions = inner_operator(problem, adjusted.state, adjusted.free, points)
        self.columns = problem.global_columns()
        #: (n,) place among the eliminated points; -1: not eliminated
        block = np.full(len(problem.network.points), -1, dtype=np.intp)
        block[unknowns.eliminated] = np.arange(len(unknowns.eliminated))
        self.block = block[problem.point]
        numbers = 2 * len(problem.image) * (len(unknowns.selection) + 9) + unknowns.n_kept_end * unknowns.count
        self.chunk = max(1, _CHUNK_NUMBERS // numbers)  #: so many samples at a time are quickest

    def repeated(self, count: int, rng: np.random.Generator) -> State:
        """The optima of `count` samples; arrays begin with the sample.

        Raises:
            NotConvergedError: the errors are so large that a sample leads nowhere.
        """
        problem, truth = self.problem, self.truth
        xy = problem.xy + problem.sigma * rng.standard_normal((count, *problem.xy.shape))
        observed = _Observed(xy, rng.standard_normal((count, len(problem.relations))))
        parts = (truth.interior, truth.position, truth.rotation, truth.xyz)
        state = State(*(np.tile(part, (count,) + (1,) * part.ndim) for part in parts))
        before, moved = np.zeros((2, count, len(self.sigma)))
        unsettled = np.arange(count)
        for number in range(_STEPS):
            step = self._gauss_newton(_taken(state, unsettled), observed.taken(unsettled)) / self.sigma
            move = _extrapolated(step, before[unsettled], moved[unsettled]) if number else step
            self._move(state, unsettled, move * self.sigma)
            before[unsettled], moved[unsettled] = step, move
            unsettled = unsettled[np.abs(step).max(axis=1) >= _ENOUGH]
            if not len(unsettled):
                return state
        raise NotConvergedError("a simulated adjustment does not settle; the errors are too large for this network")

    def _gauss_newton(self, state: State, observed: _Observed) -> Floats:
        """Steps (samples, u) in the chosen datum."""
        normals = self._normals(state, observed)
        kept, mixed = len(normals.gradient[0]) - 1, normals.mixed[..., :-1]
        scale, count = self.sigma[:kept], len(observed.xy)
        inverse = np.linalg.inv(normals.own)
        gain = inverse @ mixed
        flat = (count, -1, kept)
        reduced = normals.kept[:, :-1, :-1] - mixed.reshape(flat).swapaxes(1, 2) @ gain.reshape(flat)
        right = normals.gradient[:, :-1] - np.einsum("npik,npi->nk", gain, normals.own_gradient)
        reduced *= scale[:, None] * scale  # units in which the matrix is well-conditioned
        if self.moves.shape[1]:
            free, _ = np.linalg.qr(self.moves[:kept] / scale[:, None])
            reduced += free @ free.T
        first = -np.linalg.solve(reduced, (right * scale)[..., None])[..., 0] * scale
        second = -np.einsum("npij,npj->npi", inverse, normals.own_gradient) - np.einsum("npik,nk->npi", gain, first)
        step = np.concatenate([first, second.reshape(count, -1)], axis=1)
        in_datum: Floats = step - (step @ self.conditions.T) @ self.moves.T
        return in_datum

    def _normals(self, state: State, observed: _Observed) -> Normals:
        """Normal equations of all samples at their states; image by image, for a point is there once in an image."""
        problem, split = self.problem, self.problem.unknowns.n_kept_end
        v, by_global, by_point = self._linearised(state, observed.xy)
        normals = Normals.zeros(len(v), split, len(problem.unknowns.eliminated))
        for image, columns in enumerate(self.columns):
            within = np.arange(problem.start[image], problem.start[image + 1])
            slopes = by_global[:, within].reshape(len(v), -1, by_global.shape[-1])
            normals.add(columns, slopes, v[:, within].reshape(len(v), -1))
            rows = within[self.block[within] >= 0]
            normals.add_own(self.block[rows], columns, by_point[:, rows], by_global[:, rows], v[:, rows])
        for row in np.flatnonzero(self.block < 0):
            own, columns = problem.unknowns.point[problem.point[row]], self.columns[problem.image[row]]
            normals.add(own, by_point[:, row], v[:, row])
            normals.add_cross(own, columns, by_point[:, row], by_global[:, row])
        add_relations(normals, problem, self.truth.xyz, state.xyz, observed.errors)
        return normals

    def _linearised(self, state: State, xy: Floats) -> tuple[Floats, Floats, Floats]:
        """Whitened: residuals (samples, n, 2), derivatives by camera and pose (..., k + 6), by the point (..., 3)."""
        problem, (count, n) = self.problem, xy.shape[:2]
        lens = Lens(
            state.interior[:, problem.camera].reshape(-1, state.interior.shape[-1]),
            np.tile(problem.balance, count),
            np.tile(np.asarray(problem.measured, dtype=bool), count),
        )
        pose = state.rotation[:, problem.image].reshape(-1, 3, 3), state.position[:, problem.image].reshape(-1, 3)
        lines = linearise(lens, *pose, state.xyz[:, problem.point].reshape(-1, 3), xy.reshape(-1, 2))
        by_global = np.concatenate((lines.by_interior[:, :, problem.unknowns.selection], lines.by_pose), axis=2)
        whitener = 1.0 / problem.sigma[:, :, None]
        return (
            lines.v.reshape(count, n, 2) / problem.sigma,
            by_global.reshape(count, n, 2, -1) * whitener,
            lines.by_point.reshape(count, n, 2, 3) * whitener,
        )

    def _move(self, state: State, which: Integers, step: Floats) -> None:
        """Move some samples of a state, in place."""
        unknowns = self.problem.unknowns
        padded = np.append(step, np.zeros((len(step), 1)), axis=1)  # column -1: constants
        pose = padded[:, unknowns.pose]
        state.interior[which[:, None, None], np.arange(len(unknowns.camera))[:, None], unknowns.selection] += padded[
            :, unknowns.camera
        ]
        state.position[which] += pose[..., :3]
        state.rotation[which] = state.rotation[which] @ rotation_from_vector(pose[..., 3:])
        state.xyz[which] += padded[:, unknowns.point]


def _taken(state: State, which: Integers) -> State:
    return State(state.interior[which], state.position[which], state.rotation[which], state.xyz[which])


def _extrapolated(step: Floats, before: Floats, moved: Floats) -> Floats:
    """Where the steps of each sample would end, if they went on to shrink (or to turn) as the last two did.

    Args:
        step: this Gauss-Newton step (samples, u), in sigmas.
        before: the one before.
        moved: the move that was made in its place.
    """
    change = step - before
    size = np.sum(change**2, axis=1, keepdims=True)
    weight = np.sum(step * change, axis=1, keepdims=True) / np.where(size > 0.0, size, 1.0)
    move: Floats = step - np.clip(weight, -1.0, 1.0) * (moved + change)
    return move
