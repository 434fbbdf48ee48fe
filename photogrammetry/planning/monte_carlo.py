"""Predicted sigmas by Monte Carlo: steps 2 and 3 done again and again with new errors (Hastedt 2004).

All samples iterate together. Without camera parameters among the unknowns the normal matrix is that of the error-free
network throughout; the gradient is exact at every step, so each sample ends at its own least-squares solution.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from photogrammetry.adjustment.adjustment import Adjustment
from photogrammetry.adjustment.datum import datum_points, inner_operator
from photogrammetry.adjustment.problem import Problem
from photogrammetry.adjustment.relations import Kind
from photogrammetry.adjustment.state import State
from photogrammetry.camera_model import Lens, linearise
from photogrammetry.diagnosis import NotConvergedError
from photogrammetry.planning.plan import Flight, Plan
from photogrammetry.planning.prediction import Sigmas
from photogrammetry.planning.step_three import error_free_sights, intersect_flight
from photogrammetry.planning.step_three_samples import intersect_samples
from photogrammetry.rotation import rotation_from_vector

Floats = NDArray[np.float64]

_CHUNK_NUMBERS = 900_000  # of derivatives at a time: they stay in the cache
_STEPS = 30
_ENOUGH = 1e-3  # of a sigma; the scatter of 1000 samples is only known to 2e-2


def simulate(plan: Plan, adjusted: Adjustment, *, samples: int, seed: int) -> Sigmas:
    """Standard deviations about the true values, from repeated steps 2 and 3.

    Args:
        plan: the network.
        adjusted: its step 2 without errors.
        samples: number of repetitions.
        seed: the same seed gives the same figures.

    Raises:
        NotConvergedError: the errors are so large that step 2 leads nowhere.
    """
    rng, truth, flight = np.random.default_rng(seed), adjusted.state, plan.flight
    selection = adjusted.problem.unknowns.selection
    repeated = None if flight is None else _RepeatedFlight(plan, flight, truth)
    squares: list[tuple[Floats, ...]] = []
    chunk = max(1, _CHUNK_NUMBERS // (adjusted.problem.n_observations * adjusted.problem.unknowns.count))
    for first in range(0, samples, chunk):
        states = _Samples(adjusted, min(chunk, samples - first), rng).solved()
        errors = [states.position - truth.position, (states.interior - truth.interior)[:, :, selection]]
        errors += [] if repeated is None else repeated.errors(states, rng)
        squares.append(tuple(np.sum(error**2, axis=0) for error in errors))
    sigmas = [np.sqrt(np.sum(part, axis=0) / samples) for part in zip(*squares, strict=True)]
    sigmas += [] if repeated is not None else [np.zeros((0, 0, 3)), np.zeros((0, 0, 2))]
    positions, interior, points, angles = sigmas
    return Sigmas(positions, interior, points, angles)


class _RepeatedFlight:
    """Step 3, again and again."""

    def __init__(self, plan: Plan, flight: Flight, truth: State) -> None:
        self.network, self.flight = plan.network, flight
        self.sights = error_free_sights(plan, flight)
        self.truth = intersect_flight(plan.network, truth, self.sights)

    def errors(self, states: State, rng: np.random.Generator) -> list[Floats]:
        """Errors of points (n, t, p, 3) and angles (n, t, s, 2); tie points stay where step 2 left them."""
        flight, sights, n = self.flight, self.sights, len(states.xyz)
        noisy = replace(
            sights,
            points=sights.points + rng.normal(0.0, sights.sigma, (n, *sights.points.shape)),
            skis=sights.skis + rng.normal(0.0, sights.sigma, (n, *sights.skis.shape)),
        )
        points, angles = intersect_samples(self.network, states, noisy, self.truth)
        points = points.reshape(n, *flight.points.shape)
        tied = flight.tie >= 0
        points[:, tied] = states.xyz[:, flight.tie[tied]]
        return [points - flight.points, (angles - self.truth.angles).reshape(n, *flight.skis.shape[:2], 2)]


class _Samples:
    """Step 2 of a chunk of samples; arrays begin with the sample."""

    def __init__(self, adjusted: Adjustment, count: int, rng: np.random.Generator) -> None:
        self.problem: Problem = adjusted.problem
        self.cofactors = adjusted.cofactors
        #: whether each sample has its own normal matrix: self-calibration is too far from linear for a common one
        self.own = bool(len(self.problem.unknowns.selection))
        self.datum = _datum(adjusted)
        state = adjusted.state
        self.state = State(*(np.tile(part, (count,) + (1,) * part.ndim) for part in _parts(state)))
        problem = self.problem
        self.xy = problem.xy + problem.sigma * rng.standard_normal((count, *problem.xy.shape))
        self.errors = rng.standard_normal((count, len(problem.relations)))
        self.truth = state.xyz
        image_columns = (problem.unknowns.camera[problem.camera], problem.unknowns.pose[problem.image])
        columns = np.concatenate([*image_columns, problem.unknowns.point[problem.point]], axis=1)
        #: (n, 2, k + 9) places of the image equations in a row of equations and unknowns
        self.places = (np.arange(columns.shape[0] * 2).reshape(-1, 2, 1), columns[:, None, :])

    def solved(self) -> State:
        """The samples' optima."""
        sigma = np.sqrt(np.diagonal(self.cofactors))
        for _ in range(_STEPS):
            slopes, v = self._equations()
            gradient = (v[:, None, :] @ slopes)[:, 0]
            step: Floats
            if self.own:
                slopes *= sigma  # units in which the normal matrix is well-conditioned
                normal = slopes.transpose(0, 2, 1) @ slopes + self.datum
                scaled = np.linalg.solve(normal, sigma[:, None] * gradient[..., None])[..., 0]
                step = np.asarray(-scaled * sigma, dtype=float)
            else:
                step = -gradient @ self.cofactors
            self._move(step)
            if np.abs(step / sigma).max() < _ENOUGH:
                return self.state
        raise NotConvergedError("a simulated adjustment does not settle; the errors are too large for this network")

    def _move(self, step: Floats) -> None:
        unknowns, state = self.problem.unknowns, self.state
        padded = np.append(step, np.zeros((len(step), 1)), axis=1)  # column -1: constants
        interior, pose = state.interior.copy(), padded[:, unknowns.pose]
        interior[:, :, unknowns.selection] += padded[:, unknowns.camera]
        rotation = state.rotation @ rotation_from_vector(pose[..., 3:])
        self.state = State(interior, state.position + pose[..., :3], rotation, state.xyz + padded[:, unknowns.point])

    def _equations(self) -> tuple[Floats, Floats]:
        """Whitened derivatives (samples, rows, u) and residuals (samples, rows): image points, then relations."""
        problem, unknowns, state = self.problem, self.problem.unknowns, self.state
        count, n = self.xy.shape[:2]
        lens = Lens(
            state.interior[:, problem.camera].reshape(-1, state.interior.shape[-1]),
            np.tile(problem.balance, count),
            np.tile(np.asarray(problem.measured, dtype=bool), count),
        )
        pose = state.rotation[:, problem.image].reshape(-1, 3, 3), state.position[:, problem.image].reshape(-1, 3)
        lines = linearise(lens, *pose, state.xyz[:, problem.point].reshape(-1, 3), self.xy.reshape(-1, 2))
        parts = (lines.by_interior[:, :, unknowns.selection], lines.by_pose, lines.by_point)
        values = np.concatenate(parts, axis=2).reshape(count, n, 2, -1) / problem.sigma[:, :, None]
        slopes = np.zeros((count, 2 * n + len(problem.relations), unknowns.count + 1))
        slopes[:, self.places[0], self.places[1]] = values
        v = np.empty(slopes.shape[:2])
        v[:, : 2 * n] = (lines.v.reshape(count, n, 2) / problem.sigma).reshape(count, -1)
        self._relations(slopes[:, 2 * n :], v[:, 2 * n :])
        return slopes[:, :, :-1], v

    def _relations(self, slopes: Floats, v: Floats) -> None:
        """Fill in control points, distances and differences (a plan has no other relations)."""
        problem, xyz, columns = self.problem, self.state.xyz, self.problem.unknowns.point
        network, relations = problem.network, problem.relations
        for row, (kind, i, axis) in enumerate(zip(relations.kind, relations.item, relations.part, strict=True)):
            weight = 1.0 / problem.relation_sigma[row]
            if kind == Kind.CONTROL:
                v[:, row] = weight * (xyz[:, i, axis] - self.truth[i, axis])
                slopes[:, row, columns[i, axis]] = weight
                continue
            if kind == Kind.DIFFERENCE:
                e = network.differences[i]
                start, end, value, direction = e.start, e.end, e.value, np.eye(3)[axis]
                length = xyz[:, end, axis] - xyz[:, start, axis]
            else:
                d = network.distances[i]
                start, end, value = d.start, d.end, d.value
                direction = xyz[:, end] - xyz[:, start]
                length = np.linalg.norm(direction, axis=1)
                direction = direction / length[:, None]
            v[:, row] = weight * (length - value)
            slopes[:, row, columns[start]] = -weight * direction
            slopes[:, row, columns[end]] = weight * direction
        v -= self.errors


def _datum(adjusted: Adjustment) -> Floats:
    """What the conditions of a free network add to the normal matrix (unknowns in sigmas)."""
    if not adjusted.free.defect:
        return np.zeros((len(adjusted.cofactors),) * 2)
    problem, points = adjusted.problem, datum_points(adjusted.network)
    _, conditions = inner_operator(problem, adjusted.state, adjusted.free, points)
    directions, _ = np.linalg.qr((conditions * np.sqrt(np.diagonal(adjusted.cofactors))).T)
    added: Floats = directions @ directions.T
    return added


def _parts(state: State) -> tuple[Floats, Floats, Floats, Floats]:
    return state.interior, state.position, state.rotation, state.xyz
