"""Whether the sigmas of estimated camera parameters hold: the square sum beyond the linearisation, and better minima.

The sigma of a parameter follows from the equations linearised at the optimum. With weak geometry the sum of squares,
minimised over everything else, is no parabola over the interval that the sigma spans: the true interval is skew, or
open on one side, and another minimum may lie beyond. Both show if the parameter is held at the ends of its interval and
the rest is adjusted again (profile of the square sum; Bates and Watts 1988, Nonlinear Regression Analysis, ch. 6).
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from photogrammetry.adjustment.equations.problem import Problem, build_problem
from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.solution.adjustment import Adjustment, Parameter, only_sound_numbers
from photogrammetry.adjustment.solution.solver import one_step, solve
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from rig.arrays import Floats

#: Sigmas to the ends of an interval of 95 %.
REACH: Final = 1.96
#: On the straight line of the linearisation the square sum may miss its predicted rise by this part without a doubt.
_STRAIGHT: Final = 0.1
#: The ends of the true interval may lie this part of the sigmas' interval elsewhere; sigmas are not known better.
_SKEW: Final = 0.25
_EXACT: Final = 1e-3  # least ratio of sigma0: the residuals of error-free simulated data are rounding
_HELD_STEPS: Final = 3  # of the iteration with a parameter held: from so near a start the square sum is right to 1 %
_SEARCHED: Final = 4  # steps to an end of the interval
_FARTHER: Final = 3.0  # times as far in one step, at most
_END_SHARE: Final = 0.02  # part of REACH: nearer to an end is not looked for
_TINY: Final = 1e-9
_LOWER: Final = 1e-6  # part of the square sum by which another minimum must be lower: less is the end of an iteration


@dataclass(frozen=True, slots=True)
class Interval:
    """The interval (95 %) of a parameter whose sigma does not tell it.

    Attributes:
        camera: name.
        parameter: value and sigma by the linearisation.
        low, high: its ends; infinite where the observations give none.
    """

    camera: str
    parameter: Parameter
    low: float
    high: float

    @property
    def ends(self) -> str:
        """Its ends in words."""
        known = [f"{end:.4g}" if np.isfinite(end) else "" for end in (self.low, self.high)]
        match known:
            case ["", ""]:
                return "anywhere"
            case ["", high]:
                return f"below {high}"
            case [low, ""]:
                return f"above {low}"
            case _:
                return f"between {' and '.join(known)}"

    @property
    def words(self) -> str:
        """What is wrong, and what to do."""
        p = self.parameter
        return (
            f"camera {self.camera}: {p.name} {p.value:.6g} ± {p.sigma:.2g} is beyond its linearisation: 95 % lie "
            f"{self.ends}; add images rolled by 90 degrees or points in depth, or hold {p.name}"
        )


@dataclass(frozen=True, slots=True, eq=False)
class Curvature:
    """What the profiles of the camera parameters show.

    Attributes:
        intervals: of parameters that are beyond their linearisation.
        better: a state with a lower square sum than the optimum; None if none was met.
    """

    intervals: tuple[Interval, ...]
    better: State | None


def curvature(a: Adjustment) -> Curvature:
    """Check every estimated camera parameter; two square sums for each that is well determined.

    Args:
        a: an adjusted network; a state next to its optimum.
    """
    with np.errstate(all="ignore"):
        return _curvature(a)


def _curvature(a: Adjustment) -> Curvature:
    intervals: list[Interval] = []
    best, least = None, a.equations.square_sum * (1.0 - _LOWER)
    for camera in range(len(a.network.cameras)):
        for index, parameter in enumerate(a.parameters(camera)[0]):
            profile = _Profile(a, camera, index, parameter)
            if profile.is_linear():
                continue
            low, high = profile.end(-1.0), profile.end(1.0)
            sizes = np.abs(np.array([low, high]) - parameter.value) / (REACH * parameter.sigma)
            if np.all(np.abs(sizes - 1.0) <= _SKEW):
                continue
            intervals.append(Interval(a.network.cameras[camera].name, parameter, low, high))
            for state in profile.met.values():
                freed = _optimum(a.problem, state, a.free.defect)
                if freed is not None and a.problem.square_sum(freed) < least:
                    best, least = freed, a.problem.square_sum(freed)
    return Curvature(tuple(intervals), best)


def _optimum(problem: Problem, start: State, defect: int) -> State | None:
    """The optimum next to a state; None if there is none."""
    try:
        with only_sound_numbers():
            return solve(problem, start, defect)[0]
    except (NotConvergedError, NotSolvableError):
        return None


def _nearly(problem: Problem, state: State, defect: int, steps: int) -> State | None:
    """Where a few steps towards the optimum lead; None if they lead nowhere."""
    try:
        with only_sound_numbers():
            for _ in range(steps):
                state, arrived = one_step(problem, state, defect)
                if arrived:
                    break
    except (NotConvergedError, NotSolvableError):
        return None
    return state


class _Profile:
    """The square sum along one parameter, everything else adjusted to it.

    Attributes:
        met: the states at the ends of its interval, by their side.
    """

    def __init__(self, a: Adjustment, camera: int, index: int, parameter: Parameter) -> None:
        self.met: dict[float, State] = {}
        self._a, self._camera, self._parameter = a, camera, parameter
        columns = a.problem.unknowns.camera[camera]
        self._column = int(columns[columns >= 0][index])

    def is_linear(self) -> bool:
        """Whether the square sum rises as predicted, on the straight line of the linearisation or one step beside it.

        The step takes away most of what the others' curvature adds.
        """
        if self._a.ratio < _EXACT or not self._parameter.sigma > 0.0:
            return True
        return all(self._is_linear(sign * REACH) for sign in (-1.0, 1.0))

    def _is_linear(self, sigmas: float) -> bool:
        state = self._at(sigmas)
        if np.any(state.interior[:, 0] <= 0.0):
            return False
        if abs(self._rise(state) - REACH**2) <= _STRAIGHT * REACH**2:
            return True
        beside = _nearly(self._held, state, self._a.free.defect, 1)
        return beside is not None and abs(np.sqrt(max(self._rise(beside), 0.0)) - REACH) <= 0.5 * _SKEW * REACH

    def end(self, sign: float) -> float:
        """The end of the interval on one side; infinite if it was not met."""
        reach, rise, near = REACH, 0.0, self._at(sign * REACH)
        for _ in range(_SEARCHED):
            found = self._adjusted(near)
            if found is None:
                break
            rise = float(np.sqrt(max(self._rise(found), 0.0)))
            self.met[sign] = found
            if abs(rise - REACH) <= _END_SHARE * REACH:
                break
            farther = reach * float(np.clip(REACH / max(rise, _TINY), 1.0 / _FARTHER, _FARTHER))
            reach, near = farther, self._at(sign * (farther - reach), found)
        met = abs(rise - REACH) <= _SKEW * REACH
        return self._parameter.value + sign * reach * self._parameter.sigma if met else sign * float("inf")

    @cached_property
    def _line(self) -> Floats:
        """The step of all unknowns by which the parameter moves by one sigma, and the others follow."""
        q = self._a.cofactors[:, self._column]
        line: Floats = q / np.sqrt(q[self._column]) * self._a.scale
        return line

    @cached_property
    def _held(self) -> Problem:
        return _holding(self._a.problem, self._camera, self._parameter.name)

    def _at(self, sigmas: float, state: State | None = None) -> State:
        """A state, or the optimum, moved by so many sigmas of the parameter along the line."""
        return self._a.problem.unknowns.moved(self._a.state if state is None else state, sigmas * self._line)

    def _adjusted(self, start: State) -> State | None:
        """Everything else adjusted, the parameter as in `start`; None where there is no optimum."""
        if np.any(start.interior[:, 0] <= 0.0):
            return None
        return _nearly(self._held, start, self._a.free.defect, _HELD_STEPS)

    def _rise(self, state: State) -> float:
        a = self._a
        return (a.problem.square_sum(state) - a.equations.square_sum) / a.scale**2


def _holding(problem: Problem, camera: int, name: str) -> Problem:
    """The same problem with one parameter of a camera held at the value that the state gives it."""
    given = problem.network.cameras[camera]
    left = tuple(other for other in given.estimate if other != name)
    sigma = {other: value for other, value in given.sigma.items() if other != name}
    cameras = list(problem.network.cameras)
    cameras[camera] = replace(given, estimate=left, sigma=sigma)
    held, relations = build_problem(replace(problem.network, cameras=tuple(cameras))), problem.relations
    of_it = (relations.kind == Kind.CAMERA) & (relations.item == camera) & (relations.part == INTERIOR.index(name))
    return replace(held, sigma=problem.sigma, relation_sigma=problem.relation_sigma[~of_it])
