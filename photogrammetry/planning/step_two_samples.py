"""Repeats step 2 of a plan for many samples at a time, each with its own random errors and its own optimum.

Gauss-Newton. Points that no distance or difference ties to others are eliminated (Schur complement). Where a camera
parameter is weak (decentring beside the principal point) Gauss-Newton overshoots by a nearly constant factor. Two
successive steps determine that factor, and the next move goes to where the steps would end (Anderson's extrapolation
with a memory of one step).
"""

from dataclasses import dataclass

import numpy as np

from photogrammetry.adjustment.equations.problem import Problem
from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.datum import datum_points, inner_operator
from photogrammetry.geometry.camera_model import Lens, linearise
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.network.diagnosis import NotConvergedError
from rig.arrays import Floats, Integers

_CHUNK_NUMBERS = 400_000  # of derivatives at a time: they stay in the cache
_STEPS_MOST = 200  # few samples need many steps; only those iterate on
_SETTLED_SIGMAS = 1e-3  # of a sigma; the scatter of 4000 samples is only known to 1e-2


@dataclass(frozen=True, slots=True, eq=False)
class Normals:
    """Normal equations of n samples, in units of the sigmas; the last kept column collects the constants.

    Attributes:
        kept: (n, k + 1, k + 1) cameras, poses and points that are not eliminated.
        gradient: (n, k + 1).
        own: (n, p, 3, 3) of each eliminated point.
        own_gradient: (n, p, 3).
        mixed: (n, p, 3, k + 1).
    """

    kept: Floats
    gradient: Floats
    own: Floats
    own_gradient: Floats
    mixed: Floats

    @classmethod
    def zeros(cls, samples: int, kept: int, eliminated: int) -> "Normals":
        """Normal equations without any observation."""
        wide = kept + 1
        return cls(
            np.zeros((samples, wide, wide)),
            np.zeros((samples, wide)),
            np.zeros((samples, eliminated, 3, 3)),
            np.zeros((samples, eliminated, 3)),
            np.zeros((samples, eliminated, 3, wide)),
        )

    def add(self, columns: Integers, slopes: Floats, v: Floats) -> None:
        """Add rows with kept unknowns only: slopes (n, rows, c) by distinct `columns` (c,); residuals (n, rows)."""
        transposed = slopes.swapaxes(1, 2)
        self.kept[:, columns[:, None], columns] += transposed @ slopes
        self.gradient[:, columns] += (transposed @ v[..., None])[..., 0]

    def add_cross(self, one: Integers, other: Integers, by_one: Floats, by_other: Floats) -> None:
        """Add the mixed terms of two groups of kept unknowns; slopes (n, rows, columns)."""
        product = by_one.swapaxes(1, 2) @ by_other
        self.kept[:, one[:, None], other] += product
        self.kept[:, other[:, None], one] += product.swapaxes(1, 2)

    def add_own(self, place: Integers, columns: Integers, by_own: Floats, by_kept: Floats, v: Floats) -> None:
        """Add pairs of rows of m distinct eliminated points: slopes (n, m, 2, 3) and (n, m, 2, c)."""
        self.own[:, place] += _products(by_own, by_own)
        self.own_gradient[:, place] += by_own[:, :, 0] * v[:, :, :1] + by_own[:, :, 1] * v[:, :, 1:]
        self.mixed[:, place[:, None, None], np.arange(3)[:, None], columns] += _products(by_own, by_kept)


def _products(one: Floats, other: Floats) -> Floats:
    """Transposed `one` times `other`, both (n, m, 2, .); faster than numpy's products of many small matrices."""
    products: Floats = one[:, :, 0, :, None] * other[:, :, 0, None] + one[:, :, 1, :, None] * other[:, :, 1, None]
    return products


@dataclass(frozen=True, slots=True, eq=False)
class _Observed:
    """Observations of samples: xy (samples, n, 2); errors of the relations (samples, m), in units of their sigmas."""

    xy: Floats
    errors: Floats

    def taken(self, which: Integers) -> "_Observed":
        return _Observed(self.xy[which], self.errors[which])


class StepTwo:
    """Step 2 of a plan, prepared for repetition.

    Args:
        adjusted: the error-free adjustment.
    """

    def __init__(self, adjusted: Adjustment) -> None:
        self.problem: Problem = adjusted.problem
        self.truth = adjusted.state
        self.sigma = np.sqrt(np.diagonal(adjusted.cofactors))
        problem, unknowns = self.problem, self.problem.unknowns
        points = datum_points(adjusted.network)
        #: free motions (u, d) and the conditions (d, u) of the datum that exclude them
        self.moves, self.conditions = inner_operator(problem, adjusted.state, adjusted.free, points)
        self.columns = problem.global_columns()
        #: (n,) place among the eliminated points; -1: not eliminated
        block = np.full(len(problem.network.points), -1, dtype=np.intp)
        block[unknowns.eliminated] = np.arange(len(unknowns.eliminated))
        self.block = block[problem.point]
        numbers = 2 * len(problem.image) * (len(unknowns.selection) + 9) + unknowns.n_kept_end * unknowns.count
        self.chunk = max(1, _CHUNK_NUMBERS // numbers)  #: number of samples at a time that is fastest

    def repeated(self, count: int, rng: np.random.Generator) -> State:
        """The optima of `count` samples; arrays begin with the sample.

        Raises:
            NotConvergedError: the errors are so large that a sample does not converge.
        """
        problem, truth = self.problem, self.truth
        of_images, of_relations = self.drawn(count, rng)
        observed = _Observed(problem.xy + problem.sigma * of_images, of_relations)
        parts = (truth.interior, truth.position, truth.rotation, truth.xyz)
        state = State(*(np.tile(part, (count,) + (1,) * part.ndim) for part in parts))
        before, moved = np.zeros((2, count, len(self.sigma)))
        unsettled = np.arange(count)
        for number in range(_STEPS_MOST):
            step = self._gauss_newton(_taken(state, unsettled), observed.taken(unsettled)) / self.sigma
            move = _extrapolated(step, before[unsettled], moved[unsettled]) if number else step
            self._move(state, unsettled, move * self.sigma)
            before[unsettled], moved[unsettled] = step, move
            unsettled = unsettled[np.abs(step).max(axis=1) >= _SETTLED_SIGMAS]
            if not len(unsettled):
                return state
        raise NotConvergedError("a simulated adjustment does not settle; the errors are too large for this network")

    def drawn(self, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Errors of the observations of so many samples, in units of their sigmas: images, relations."""
        of_images = rng.standard_normal((count, *self.problem.xy.shape))
        return of_images, rng.standard_normal((count, len(self.problem.relations)))

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
        """Normal equations of all samples at their states, image by image: an image has each point once."""
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
    """The move to where the steps of each sample would end if each shrank (or turned) as the last did.

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


def add_relations(normals: Normals, problem: Problem, truth: Floats, xyz: Floats, errors: Floats) -> None:
    """Control points, distances and differences (a plan has no other relations).

    Args:
        normals: to add to.
        problem: the planned network.
        truth: (points, 3).
        xyz: (n, points, 3) of the samples.
        errors: (n, m) of the observed values, whitened.
    """
    network, relations, unknowns = problem.network, problem.relations, problem.unknowns
    for row, (kind, i, axis) in enumerate(zip(relations.kind, relations.item, relations.part, strict=True)):
        weight, error = 1.0 / problem.relation_sigma[row], errors[:, row]
        if kind == Kind.CONTROL:
            v, column = weight * (xyz[:, i, axis] - truth[i, axis]) - error, unknowns.point[i, axis]
            if column < unknowns.n_kept_end:
                normals.kept[:, column, column] += weight**2
                normals.gradient[:, column] += weight * v
            else:
                place = (column - unknowns.n_kept_end) // 3
                normals.own[:, place, axis, axis] += weight**2
                normals.own_gradient[:, place, axis] += weight * v
            continue
        if kind == Kind.DIFFERENCE:
            e = network.differences[i]
            start, end, value = e.start, e.end, e.value
            direction = np.broadcast_to(np.eye(3)[axis], (len(xyz), 3))
            length = xyz[:, end, axis] - xyz[:, start, axis]
        else:
            d = network.distances[i]
            start, end, value = d.start, d.end, d.value
            direction = xyz[:, end] - xyz[:, start]
            length = np.linalg.norm(direction, axis=1)
            direction = direction / length[:, None]
        slopes = weight * np.concatenate([-direction, direction], axis=1)[:, None]
        columns = np.append(unknowns.point[start], unknowns.point[end])
        normals.add(columns, slopes, (weight * (length - value) - error)[:, None])
