"""Minimises the weighted square sum of the residuals by damped Gauss-Newton steps.

A step that leads too far is shortened, then damped (Levenberg); at the optimum no damping is left. Where Gauss-Newton
creeps or overshoots (large residuals, weak geometry), successive steps shrink by nearly constant factors along a few
directions; Anderson's extrapolation jumps where these would end. A jump is only a proposal: the square sum decides.
"""

from dataclasses import dataclass, field

import numpy as np

from photogrammetry.adjustment.equations.problem import Equations, Problem
from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.solution.datum import NOTHING_FREE, FreeDatum, find_free_datum, similarity_directions
from photogrammetry.adjustment.solution.normals import Normals, SingularError, build_normals, factorise
from photogrammetry.network.diagnosis import NotConvergedError
from rig.arrays import Floats
from rig.phrase import phrase

MAX_ITERATIONS = 60
#: The iteration ends when the next undamped step moves no quantity by more than this part of its standard deviation.
ARRIVED = 1e-5
#: Least ratio of sigma0 for `ARRIVED`: error-free simulated data have residuals of rounding only.
_EXACT = 1e-3
#: A Gauss-Newton step that leads too far is shortened down to this part; if that fails, damping changes its direction.
_SHORTEST = 1.0 / 32.0
#: A step must achieve this part of the reduction of the square sum that the linearisation predicts.
_KEPT = 0.1
_FIRST_DAMPING = 1e-8
_MOST_DAMPING = 1e8
_MORE, _LESS = 10.0, 0.1
#: A change of the square sum below this part of it is rounding.
_ROUNDING = 1e-12
_MEMORY = 4
_LONGEST = 4.0  # times the Gauss-Newton step, by their effects on the residuals


class Acceleration:
    """Anderson's extrapolation: remembers the last steps (u,), unscaled, and proposes moves."""

    def __init__(self) -> None:
        self._steps: list[Floats] = []
        self._moves: list[Floats] = []

    def forget(self) -> None:
        """Drop the remembered steps, after a step that was not a Gauss-Newton step."""
        self._steps, self._moves = [], []

    def record(self, step: Floats, move: Floats) -> None:
        """Remember a Gauss-Newton step and the move that was made in its place."""
        self._steps = [*self._steps, step][-_MEMORY:]
        self._moves = [*self._moves, move][-_MEMORY:]

    def propose(self, normals: Normals, step: Floats) -> Floats | None:
        """A move to where the steps seem to end; None without remembered steps, or if it is too long."""
        if not self._steps:
            return None
        changes = np.diff(np.array([*self._steps, step]), axis=0).T
        scaled = changes / normals.scale[:, None]
        # in the metric of the residuals, so that the units of the unknowns do not matter
        felt = normals.times(scaled)
        weights, *_ = np.linalg.lstsq(scaled.T @ felt, felt.T @ (step / normals.scale), rcond=1e-10)
        proposal: Floats = step - (np.array(self._moves).T + changes) @ weights
        if _size(normals, proposal) > _LONGEST * _size(normals, step):
            return None
        return proposal


def _size(normals: Normals, step: Floats) -> float:
    scaled = (step / normals.scale)[:, None]
    return float(np.sqrt(max(0.0, float(np.vdot(scaled, normals.times(scaled))))))


@dataclass(slots=True)
class _Progress:
    """State of the iteration; `behind` counts the points behind their cameras."""

    state: State
    square_sum: float
    behind: int
    damping: float = 0.0
    iterations: int = 0
    acceleration: Acceleration = field(default_factory=Acceleration)


def solve(problem: Problem, start: State, defect: int) -> tuple[State, int, FreeDatum]:
    """Minimise the sum of squared weighted residuals.

    Args:
        problem: the network made ready.
        start: start values.
        defect: number of similarity transformations that change no residual; where the solution ends along them is
            arbitrary.

    Returns:
        The optimum, the number of accepted steps, and the free similarity transformations there.

    Raises:
        NotConvergedError: no optimum within `MAX_ITERATIONS`, or none reachable.
    """
    progress = _begin(problem, start)
    while progress.iterations < MAX_ITERATIONS:
        free = _iterate(problem, progress, defect)
        if free is not None:
            return progress.state, progress.iterations, free
    text = "no optimum after {most} iterations; give better start values, or estimate fewer camera parameters"
    raise NotConvergedError(phrase("unconverged_iterations", text, most=MAX_ITERATIONS))


def one_step(problem: Problem, start: State, defect: int) -> tuple[State, bool]:
    """One accepted step from `start`, and whether it reached the optimum.

    Raises:
        NotConvergedError: no step reduces the square sum.
    """
    progress = _begin(problem, start)
    arrived = _iterate(problem, progress, defect) is not None
    return progress.state, arrived


def _begin(problem: Problem, start: State) -> _Progress:
    progress = _Progress(start, problem.square_sum(start), problem.behind(start))
    if not np.isfinite(progress.square_sum):
        text = "the start values have no images (a point in a projection centre); give better ones"
        raise NotConvergedError(phrase("unconverged_start", text))
    return progress


def _iterate(problem: Problem, progress: _Progress, defect: int) -> FreeDatum | None:
    """One step; returns the free motions once it has reached the optimum, else None."""
    redundancy = max(1, problem.n_observations - problem.unknowns.count + defect)
    equations = problem.equations(progress.state)
    normals = build_normals(problem, equations)
    sigma0 = max(np.sqrt(equations.square_sum / redundancy), _EXACT)
    free = find_free_datum(problem, normals, progress.state, defect) if defect else NOTHING_FREE
    enough = max(ARRIVED * sigma0, _coordinate_noise(problem, equations, progress.state))
    return free if _advance(problem, normals, free, progress, enough) else None


def _coordinate_noise(problem: Problem, equations: Equations, state: State) -> float:
    """Effect of the rounding of coordinates on a step: they may count from a far origin (a national grid)."""
    largest = max(np.abs(state.xyz).max(initial=0.0), np.abs(state.position).max(initial=0.0))
    slope = np.abs(equations.by_point).max(initial=0.0)
    return float(np.finfo(float).eps * largest * slope * np.sqrt(problem.unknowns.count))


def _advance(problem: Problem, normals: Normals, free: FreeDatum, progress: _Progress, enough: float) -> bool:
    """One accepted step, shortened and damped as far as needed; True once it has reached the optimum."""
    damping = progress.damping
    while damping <= _MOST_DAMPING:
        step = _step(problem, normals, free, progress.state, damping)
        if step is not None:
            slope = -float(normals.gradient @ (step / normals.scale))  # of half the square sum, along the step
            if damping == 0.0 and slope <= enough**2:
                progress.state = problem.unknowns.moved(progress.state, step)
                progress.iterations += 1
                return True
            if damping == 0.0 and _leap(problem, normals, progress, step, slope):
                return False
            shortest = _SHORTEST if damping == 0.0 else 1.0
            if _descend(problem, progress, step, slope, shortest):
                progress.damping = damping * _LESS if damping > _FIRST_DAMPING else 0.0
                return False
        damping = max(_FIRST_DAMPING, damping * _MORE)
    text = "no step reduces the residuals any more; give better start values"
    raise NotConvergedError(phrase("unconverged_step", text))


def _step(problem: Problem, normals: Normals, free: FreeDatum, state: State, damping: float) -> Floats | None:
    """The step of all unknowns; None where the normal matrix is not positive definite."""
    directions = np.zeros((len(normals.scale), 0))
    if free.defect and damping == 0.0:
        moves = similarity_directions(problem, state, free.centre) @ free.directions
        directions = moves / normals.scale[:, None]
    try:
        return factorise(normals, directions, damping).solve()
    except SingularError:
        return None


def _leap(problem: Problem, normals: Normals, progress: _Progress, step: Floats, slope: float) -> bool:
    """Take the extrapolated step instead, if there is one and it reduces the square sum enough."""
    proposal = progress.acceleration.propose(normals, step)
    if proposal is None or not _try(problem, progress, proposal, _KEPT * slope):
        return False
    progress.acceleration.record(step, proposal)
    return True


def _descend(problem: Problem, progress: _Progress, step: Floats, slope: float, shortest: float) -> bool:
    """Take the step, or a shorter one, if it achieves enough of the predicted reduction."""
    part = 1.0
    while part >= shortest:
        # If the equations were linear, the square sum would fall by (2 - part) part slope.
        if _try(problem, progress, part * step, _KEPT * (2.0 - part) * part * slope):
            if shortest < 1.0:
                progress.acceleration.record(step, part * step)
            else:
                progress.acceleration.forget()
            return True
        part *= 0.5
    return False


def _try(problem: Problem, progress: _Progress, move: Floats, wanted: float) -> bool:
    """Move if the new state is possible and the square sum falls by `wanted`, or if `wanted` is below rounding."""
    state = problem.unknowns.moved(progress.state, move)
    square_sum, behind = problem.square_sum(state), problem.behind(state)
    if not np.isfinite(square_sum) or behind > progress.behind or np.any(state.interior[:, 0] <= 0.0):
        return False
    if progress.square_sum - square_sum < wanted and wanted > _ROUNDING * progress.square_sum:
        return False
    progress.state, progress.square_sum, progress.behind = state, square_sum, behind
    progress.iterations += 1
    return True
