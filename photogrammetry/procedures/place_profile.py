"""Whether the sigma of a projection centre holds: the square sum along the axis in which it is known worst.

The sigma follows from equations linearised at the optimum. A small field from afar, or one whose points nearly lie on a
line, leaves the camera so free that the square sum, minimised over everything else, rises much more slowly on one side
(profile of the square sum; Bates and Watts 1988, Nonlinear Regression Analysis, ch. 6), and the true place may lie
beyond ten such sigmas.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from photogrammetry.adjustment.equations.problem import Problem, build_problem
from photogrammetry.adjustment.solution.adjustment import Adjustment, only_sound_numbers
from photogrammetry.adjustment.solution.solver import solve
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from rig.arrays import Floats

#: Sigmas to the ends of the interval in which a place lies for sure.
_REACH: Final = 5
#: The square sum must rise as far from the optimum as over so many sigmas of the linearisation: 6e-5 lies beyond.
_RISE_LEAST_SIGMAS: Final = 4.0
#: The equations are linear over a smaller part of the distance to the points than this.
_LINEAR: Final = 0.1
#: Sigma by which the place is held, in sigmas of it, and of the axes that are free, in distances.
_HELD: Final = 1e-3
_FREE: Final = 1e6


def place_holds(a: Adjustment, image: int) -> bool:
    """Whether the projection centre of an image lies within five sigmas of its place for sure.

    Args:
        a: an adjusted network.
        image: index of an image whose pose is estimated.
    """
    columns = a.problem.unknowns.pose[image, :3]
    observed = a.network.observations.point[a.network.observations.image == image]
    distance = float(np.median(np.linalg.norm(a.state.xyz[observed] - a.state.position[image], axis=1)))
    sigma = np.where(columns >= 0, a.sigmas(columns), 0.0)
    axis = int(sigma.argmax())
    if _REACH * sigma[axis] < _LINEAR * distance:
        return True
    return all(_rises(a, image, axis, sign * float(sigma[axis]), distance) for sign in (-1, 1))


def _rises(a: Adjustment, image: int, axis: int, step: float, distance: float) -> bool:
    """Whether the square sum rises enough on one side, over `_REACH` steps of a sigma each."""
    cofactors = a.cofactors[:, a.problem.unknowns.pose[image, axis]]
    line = step / cofactors[a.problem.unknowns.pose[image, axis]] * cofactors
    state = a.state
    for k in range(1, _REACH + 1):
        place = a.state.position[image].copy()
        place[axis] += k * step
        problem = _held(a, image, axis, place, distance)
        try:
            with only_sound_numbers():
                state, _, _ = solve(problem, problem.unknowns.moved(state, line), a.free.defect)
        except (NotConvergedError, NotSolvableError):
            return False  # nothing holds the others there
    rise = a.problem.square_sum(state) - a.equations.square_sum
    return bool(rise >= (_RISE_LEAST_SIGMAS * a.scale) ** 2)


def _held(a: Adjustment, image: int, axis: int, place: Floats, distance: float) -> Problem:
    """The network with the place of an image observed along one axis."""
    sigma = np.full(3, _FREE * distance)
    sigma[axis] = _HELD * a.sigmas(a.problem.unknowns.pose[image, axis])
    images = list(a.network.images)
    images[image] = replace(images[image], position=place, sigma_position=sigma)
    return build_problem(replace(a.network, images=tuple(images)))
