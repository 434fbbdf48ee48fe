"""Damped Gauss-Newton: the damping helps on the way and is gone at the optimum."""

from dataclasses import dataclass

import numpy as np

from photogrammetry.adjustment.datum import FreeDatum, similarity_directions
from photogrammetry.adjustment.normals import Normals, SingularError, build_normals, factorise
from photogrammetry.adjustment.problem import Problem
from photogrammetry.adjustment.state import Floats, State
from photogrammetry.diagnosis import NotConvergedError

MAX_ITERATIONS = 60
#: Arrived when the next undamped step moves no quantity by more than this part of its standard deviation.
ARRIVED = 1e-6
#: Residuals smaller than this part of their a-priori sigmas are rounding (error-free simulated data).
_EXACT = 1e-3
_FIRST_DAMPING = 1e-4
_MOST_DAMPING = 1e8
_LEAST_DAMPING = 1e-7
#: A change of the square sum below this part of it cannot be measured any more.
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where the iteration ended.

    Attributes:
        state: the optimum.
        iterations: accepted steps.
    """

    state: State
    iterations: int


@dataclass(slots=True)
class _Progress:
    """What the iteration carries along."""

    state: State
    square_sum: float
    behind: int
    damping: float = 0.0
    iterations: int = 0


def solve(problem: Problem, start: State, free: FreeDatum) -> Solution:
    """Minimise the sum of squared weighted residuals.

    Args:
        problem: the network made ready.
        start: start values.
        free: similarity transformations that no observation sees; the way along them is arbitrary but fixed.

    Raises:
        NotConvergedError: no optimum within `MAX_ITERATIONS`, or none reachable.
    """
    progress = _Progress(start, problem.square_sum(start), problem.behind(start))
    if not np.isfinite(progress.square_sum):
        raise NotConvergedError("the start values have no images (a point in a projection centre); give better ones")
    redundancy = max(1, problem.n_observations - problem.unknowns.count + free.defect)
    while progress.iterations < MAX_ITERATIONS:
        equations = problem.equations(progress.state)
        normals = build_normals(problem, equations)
        sigma0 = max(np.sqrt(equations.square_sum / redundancy), _EXACT)
        if _advance(problem, normals, free, progress, ARRIVED * sigma0):
            return Solution(progress.state, progress.iterations)
    raise NotConvergedError(
        f"no optimum after {MAX_ITERATIONS} iterations; give better start values, or estimate fewer camera parameters"
    )


def _advance(problem: Problem, normals: Normals, free: FreeDatum, progress: _Progress, enough: float) -> bool:
    """One accepted step, with as much damping as it takes; True when it was the last one."""
    while True:
        step = _step(problem, normals, free, progress)
        if step is not None:
            drop = -float(normals.gradient @ (step / normals.scale))  # of half the square sum, for a full step
            if progress.damping == 0.0 and drop <= enough**2:
                progress.state = problem.unknowns.moved(progress.state, step)
                progress.iterations += 1
                return True
            if _accept(problem, progress, step, drop):
                return False
        progress.damping = max(_FIRST_DAMPING, 10.0 * progress.damping)
        if progress.damping > _MOST_DAMPING:
            raise NotConvergedError("no step reduces the residuals any more; give better start values")


def _step(problem: Problem, normals: Normals, free: FreeDatum, progress: _Progress) -> Floats | None:
    directions = np.zeros((len(normals.scale), 0))
    if free.defect and progress.damping == 0.0:
        moves = similarity_directions(problem, progress.state, free.centre) @ free.directions
        directions = moves / normals.scale[:, None]
    try:
        return factorise(normals, directions, progress.damping).solve()
    except SingularError:
        return None


def _accept(problem: Problem, progress: _Progress, step: Floats, drop: float) -> bool:
    """Take the step if it reduces the square sum about as much as promised."""
    state = problem.unknowns.moved(progress.state, step)
    square_sum, behind = problem.square_sum(state), problem.behind(state)
    if not np.isfinite(square_sum) or behind > progress.behind or np.any(state.interior[:, 0] <= 0.0):
        return False
    if drop > _ROUNDING * progress.square_sum:
        gain = (progress.square_sum - square_sum) / drop  # 1 for a linear problem, up to 2 with much damping
        if gain < 1e-3:
            return False
        progress.damping = progress.damping / 10.0 if gain > 0.25 else progress.damping * 2.0
    if progress.damping < _LEAST_DAMPING or drop < _ROUNDING * progress.square_sum:
        progress.damping = 0.0
    progress.state, progress.square_sum, progress.behind = state, square_sum, behind
    progress.iterations += 1
    return True
