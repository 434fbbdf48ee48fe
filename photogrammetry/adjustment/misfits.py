"""Where an adjustment does not converge: the observations that do not fit what all others say."""

import numpy as np

from photogrammetry.adjustment.blunders import Blunder, BlunderKind, Observation
from photogrammetry.adjustment.problem import build_problem
from photogrammetry.adjustment.rank import check_rank
from photogrammetry.adjustment.solver import robust_state
from photogrammetry.adjustment.state import State
from photogrammetry.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.network import Network

#: A misfit is so many times worse than what is typical.
_MISFIT = 20.0
#: If more than this part of the image points are misfits, it is not they that are wrong.
_TOO_MANY = 0.05


def find_misfits(network: Network, start: State) -> tuple[list[Blunder], State]:
    """Image points that stand out of a robust adjustment, the worst first, and the values it ended with.

    Empty if that does not lead anywhere either.
    """
    problem = build_problem(network)
    try:
        state = robust_state(problem, start, check_rank(problem, start).defect)
    except (NotConvergedError, NotSolvableError, np.linalg.LinAlgError):
        return [], start
    v = problem.equations(state).v
    sizes = np.linalg.norm(v, axis=1)
    typical = max(float(np.median(sizes)), 1.0)
    found = [int(i) for i in np.argsort(-sizes, kind="stable") if sizes[i] > _MISFIT * typical]
    if len(found) > _TOO_MANY * len(sizes):
        return [], start
    worse = np.argmax(np.abs(v), axis=1)
    return [
        Blunder(
            Observation(BlunderKind.IMAGE, int(problem.order[i])),
            -v[i] * problem.sigma[i],
            float(v[i, worse[i]]) / typical,
            locatable=True,
            candidates=(),
            margin=np.inf,
        )
        for i in found
    ], state
