"""What a network says if gross errors have no say: a robust solution, and the tests linearised there.

At a least-squares optimum that a gross error has bent, the linear tests may accuse its neighbours; and there may be no
optimum at all. So the weights of what fits badly are lowered step by step, first with the interior orientation held.
The tests of `hypotheses` are then those of an adjustment with all observations, linearised where the sound ones agree.
"""

from dataclasses import replace

import numpy as np

from photogrammetry.adjustment.adjustment import Adjustment, cofactors_at, only_sound_numbers
from photogrammetry.adjustment.datum import datum_points
from photogrammetry.adjustment.normals import build_normals
from photogrammetry.adjustment.problem import Equations, Problem, build_problem
from photogrammetry.adjustment.rank import check_rank
from photogrammetry.adjustment.solver import one_step
from photogrammetry.adjustment.state import Floats, State
from photogrammetry.adjustment.statistics import redundancy
from photogrammetry.diagnosis import NotConvergedError
from photogrammetry.network import Network

_BOUNDED_STEPS, _REDESCENDING_STEPS = 15, 30
_DOUBTFUL = 2.0  # typical residuals: from here on an observation counts less (Huber),
_SUSPECT = 3.0  # and from about here on hardly at all (Geman and McClure)
_MEDIAN = 1.1774  # of the length of a vector of two standard normal numbers
_MOST_DOUBT = 1e4


def robust_state(network: Network, start: State) -> State:
    """Values that a few gross errors do not draw away.

    Args:
        network: any network.
        start: start values.

    Raises:
        NotSolvableError: a rank defect.
        NotConvergedError: it leads nowhere.
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
    """Steps with larger standard deviations for what fits badly, anew each time."""
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
    """By how much a standard deviation grows with the size of its residual."""
    if redescending:
        return np.asarray(np.minimum(1.0 + (size / _SUSPECT) ** 2, _MOST_DOUBT))
    return np.asarray(np.sqrt(np.maximum(size / _DOUBTFUL, 1.0)))


def linearised_at(network: Network, state: State) -> Adjustment:
    """An adjustment of all observations by one linear step from a state; its residuals are those after the step.

    It serves for tests alone: state and cofactors are those before the step.

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
    step = np.append(-cofactors @ (normals.gradient / normals.scale), 0.0)  # column -1: nothing
    image = np.einsum("nrk,nk->nr", equations.by_global, step[problem.global_columns()][problem.image])
    image += np.einsum("nrk,nk->nr", equations.by_point, step[problem.unknowns.point][problem.point])
    relations = equations.relations
    other = np.einsum("mk,mk->m", relations.values, step[relations.columns])
    return replace(equations, v=equations.v + image, relations=replace(relations, v=relations.v + other))
