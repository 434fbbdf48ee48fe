"""Damped Gauss-Newton: shorter steps, then Levenberg's damping, help on the way and are gone at the optimum."""

from dataclasses import dataclass, field

import numpy as np

from photogrammetry.adjustment.acceleration import Acceleration
from photogrammetry.adjustment.datum import NOTHING_FREE, FreeDatum, find_free_datum, similarity_directions
from photogrammetry.adjustment.normals import Normals, SingularError, build_normals, factorise
from photogrammetry.adjustment.problem import Equations, Problem
from photogrammetry.adjustment.state import Floats, State
from photogrammetry.diagnosis import NotConvergedError

MAX_ITERATIONS = 60
#: Arrived when the next undamped step moves no quantity by more than this part of its standard deviation.
ARRIVED = 1e-5
#: Residuals smaller than this part of their a-priori sigmas are rounding (error-free simulated data).
_EXACT = 1e-3
#: A Gauss-Newton step that leads too far is shortened down to this part; after that it is the direction that is wrong.
_SHORTEST = 1.0 / 32.0
#: Part of the promised reduction of the square sum that a step must keep.
_KEPT = 0.1
_FIRST_DAMPING = 1e-8
_MOST_DAMPING = 1e8
_MORE, _LESS = 10.0, 0.1
#: A change of the square sum below this part of it cannot be measured any more.
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """Where the iteration ended.

    Attributes:
        state: the optimum.
        iterations: accepted steps.
        free: the free similarity transformations there.
    """

    state: State
    iterations: int
    free: FreeDatum


@dataclass(slots=True)
class _Progress:
    """What the iteration carries along."""

    state: State
    square_sum: float
    behind: int
    damping: float = 0.0
    iterations: int = 0
    acceleration: Acceleration = field(default_factory=Acceleration)


def solve(problem: Problem, start: State, defect: int) -> Solution:
    """Minimise the sum of squared weighted residuals.

    Args:
        problem: the network made ready.
        start: start values.
        defect: number of similarity transformations that no observation sees; the way along them is arbitrary.

    Raises:
        NotConvergedError: no optimum within `MAX_ITERATIONS`, or none reachable.
    """
    progress = _begin(problem, start)
    while progress.iterations < MAX_ITERATIONS:
        free = _iterate(problem, progress, defect)
        if free is not None:
            return Solution(progress.state, progress.iterations, free)
    raise NotConvergedError(
        f"no optimum after {MAX_ITERATIONS} iterations; give better start values, or estimate fewer camera parameters"
    )


def one_step(problem: Problem, start: State, defect: int) -> tuple[State, bool]:
    """One accepted step from `start`, and whether it was the last one.

    Raises:
        NotConvergedError: it leads nowhere.
    """
    progress = _begin(problem, start)
    arrived = _iterate(problem, progress, defect) is not None
    return progress.state, arrived


def _begin(problem: Problem, start: State) -> _Progress:
    progress = _Progress(start, problem.square_sum(start), problem.behind(start))
    if not np.isfinite(progress.square_sum):
        raise NotConvergedError("the start values have no images (a point in a projection centre); give better ones")
    return progress


def _iterate(problem: Problem, progress: _Progress, defect: int) -> FreeDatum | None:
    """One step; the free motions at the optimum when it was the last one."""
    redundancy = max(1, problem.n_observations - problem.unknowns.count + defect)
    equations = problem.equations(progress.state)
    normals = build_normals(problem, equations)
    sigma0 = max(np.sqrt(equations.square_sum / redundancy), _EXACT)
    free = find_free_datum(problem, normals, progress.state, defect) if defect else NOTHING_FREE
    enough = max(ARRIVED * sigma0, _coordinate_noise(problem, equations, progress.state))
    return free if _advance(problem, normals, free, progress, enough) else None


def _coordinate_noise(problem: Problem, equations: Equations, state: State) -> float:
    """What the last bit of the coordinates does to a step: they may be counted from far away (a national grid)."""
    largest = max(np.abs(state.xyz).max(initial=0.0), np.abs(state.position).max(initial=0.0))
    slope = np.abs(equations.by_point).max(initial=0.0)
    return float(np.finfo(float).eps * largest * slope * np.sqrt(problem.unknowns.count))


def _advance(problem: Problem, normals: Normals, free: FreeDatum, progress: _Progress, enough: float) -> bool:
    """One accepted step, as short and as damped as it takes; True when it was the last one."""
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
    raise NotConvergedError("no step reduces the residuals any more; give better start values")


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
    """Take the accelerated step instead, if there is one and it reduces the square sum as a good step would."""
    proposal = progress.acceleration.propose(normals, step)
    if proposal is None or not _try(problem, progress, proposal, _KEPT * slope):
        return False
    progress.acceleration.record(step, proposal)
    return True


def _descend(problem: Problem, progress: _Progress, step: Floats, slope: float, shortest: float) -> bool:
    """Take the step, or a shorter one, if it keeps enough of its promise."""
    part = 1.0
    while part >= shortest:
        # Along a straight way the square sum falls by (2 - part) part slope.
        if _try(problem, progress, part * step, _KEPT * (2.0 - part) * part * slope):
            if shortest < 1.0:
                progress.acceleration.record(step, part * step)
            else:
                progress.acceleration.forget()
            return True
        part *= 0.5
    return False


def _try(problem: Problem, progress: _Progress, move: Floats, wanted: float) -> bool:
    """Move if that is possible and the square sum falls by what is wanted, as far as that can be measured."""
    state = problem.unknowns.moved(progress.state, move)
    square_sum, behind = problem.square_sum(state), problem.behind(state)
    if not np.isfinite(square_sum) or behind > progress.behind or np.any(state.interior[:, 0] <= 0.0):
        return False
    if progress.square_sum - square_sum < wanted and wanted > _ROUNDING * progress.square_sum:
        return False
    progress.state, progress.square_sum, progress.behind = state, square_sum, behind
    progress.iterations += 1
    return True
