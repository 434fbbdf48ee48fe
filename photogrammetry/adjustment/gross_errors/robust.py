"""A robust solution that a few gross errors do not draw away, and an adjustment linearised there for the tests.

At a least-squares optimum that a gross error has shifted, the linear tests may accuse sound observations; and there may
be no optimum at all. So the robust solution lowers the weights of observations with large residuals step by step, first
with the interior orientation held. The tests of `hypotheses` then take all observations, linearised at that solution.
"""

from dataclasses import replace

import numpy as np

from photogrammetry.adjustment.equations.problem import Equations, Problem, build_problem
from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.solution.adjustment import Adjustment, cofactors_at, only_sound_numbers
from photogrammetry.adjustment.solution.datum import datum_points
from photogrammetry.adjustment.solution.normals import build_normals
from photogrammetry.adjustment.solution.rank import check_rank
from photogrammetry.adjustment.solution.solver import one_step
from photogrammetry.adjustment.solution.statistics import redundancy
from photogrammetry.network.diagnosis import NotConvergedError
from photogrammetry.network.model import Network
from rig.arrays import Floats

_BOUNDED_STEPS, _REDESCENDING_STEPS = 15, 30
_DOUBTFUL = 2.0  # typical residuals; larger residuals get less weight (Huber)
_SUSPECT = 3.0  # typical residuals; beyond about this hardly any weight is left (Geman and McClure)
_MEDIAN = 1.1774  # of the length of a vector of two standard normal numbers
_MOST_DOUBT = 1e4


def robust_state(network: Network, start: State) -> State:
    """The robust solution.

    Args:
        network: any network.
        start: start values.

    Raises:
        NotSolvableError: a rank defect.
        NotConvergedError: no step reduces the square sum.
    """
    state = start
    if any(camera.estimate for camera in network.cameras):
        held = tuple(replace(camera, estimate=(), sigma={}) for camera in network.cameras)
        problem = build_problem(replace(network, cameras=held))
        state = _softened(problem, state, _BOUNDED_STEPS, redescending=False)
    problem = build_problem(network)
    state = _softened(problem, state, _BOUNDED_STEPS, redescending=False)
    return _softened(problem, state, _REDESCENDING_STEPS, redescending=True)


def _softened(problem: Problem, state: State, steps: int, *, redescending: bool) -> State:
    """Steps with standard deviations that grow with the residuals, computed anew for each step."""
    defect = check_rank(problem, state).defect
    for _ in range(steps):
        equations = problem.equations(state)
        image = np.linalg.norm(equations.v, axis=1) / _MEDIAN
        typical = max(float(np.median(image)) if len(image) else 0.0, 1.0)
        other = np.abs(equations.relations.v) / typical
        doubts = [_doubt(size, redescending=redescending) for size in (image / typical, other)]
        softened = replace(
            problem,
            sigma=problem.sigma * typical * doubts[0][:, None],
            relation_sigma=problem.relation_sigma * typical * doubts[1],
        )
        state, arrived = one_step(softened, state, defect)
        if arrived:
            break
    return state


def _doubt(size: Floats, *, redescending: bool) -> Floats:
    """Factors on the standard deviations for residuals of some sizes, in typical residuals."""
    if redescending:
        return np.asarray(np.minimum(1.0 + (size / _SUSPECT) ** 2, _MOST_DOUBT))
    return np.asarray(np.sqrt(np.maximum(size / _DOUBTFUL, 1.0)))


def linearised_at(network: Network, state: State) -> Adjustment:
    """An adjustment of all observations by one linear step from a state; its residuals are those after the step.

    For the tests only: state and cofactors are those before the step.

    Raises:
        NotSolvableError: a rank defect there.
        NotConvergedError: the numbers leave all bounds.
    """
    problem = build_problem(network)
    with only_sound_numbers():
        free = check_rank(problem, state)
        equations = problem.equations(state)
        cofactors = cofactors_at(problem, state, equations, free, datum_points(network))
        after = _after_step(problem, equations, cofactors)
        if not np.isfinite(after.square_sum):
            raise NotConvergedError("the numbers leave all bounds; check units and sigmas, or give start values")
        return Adjustment(problem, state, 0, free, after, cofactors, redundancy(problem, equations, cofactors))


def _after_step(problem: Problem, equations: Equations, cofactors: Floats) -> Equations:
    """The equations with the residuals v - J Q J^T v."""
    normals = build_normals(problem, equations)
    step = np.append(-cofactors @ (normals.gradient / normals.scale), 0.0)  # column -1: constants
    image = np.einsum("nrk,nk->nr", equations.by_global, step[problem.global_columns()][problem.image])
    image += np.einsum("nrk,nk->nr", equations.by_point, step[problem.unknowns.point][problem.point])
    relations = equations.relations
    other = np.einsum("mk,mk->m", relations.values, step[relations.columns])
    return replace(equations, v=equations.v + image, relations=replace(relations, v=relations.v + other))
