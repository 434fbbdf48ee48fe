"""Variance components: estimates how accurate each group of observations is.

Helmert/Foerstner: factor^2 = vTPv of the group / its redundancy (sum of its redundancy numbers), repeated with the new
weights until no factor changes. The paper (D5) takes n2 - 7 for the redundancy of n2 reference points.
"""

from dataclasses import dataclass, replace

import numpy as np

from photogrammetry.adjustment.equations.problem import Problem
from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.solution.adjustment import Adjustment, refine
from photogrammetry.network.diagnosis import NotConvergedError
from rig.arrays import Flags, Floats, Integers
from rig.errors import BadInputError

#: The iteration ends when no factor changes by more than this part of itself.
_SETTLED = 1e-8
_MAX_ROUNDS = 100
#: A group with less redundancy counts as not controlled.
_NO_REDUNDANCY = 1e-3
#: A group whose factor falls below this has too little redundancy to be estimated.
_FLOOR = 1e-4
_MEMORY = 3  # rounds that the extrapolation looks back
#: Equation D5b subtracts so many from the number of reference points.
_PAPER_CONDITIONS = 7


@dataclass(frozen=True, slots=True)
class Component:
    """One group.

    Attributes:
        group: its name.
        factor: estimated / a-priori sigma; None without redundancy.
        sigma: estimated sigma, where the group has a single a-priori one.
        redundancy: of the group, at the end.
    """

    group: str
    factor: float | None
    sigma: float | None
    redundancy: float


@dataclass(frozen=True, slots=True, eq=False)
class _Groups:
    """Which observation belongs to which group: names, (n,) and (m,) indices."""

    names: tuple[str, ...]
    image: Integers
    relation: Integers


def estimate_components(adjustment: Adjustment) -> tuple[tuple[Component, ...], Adjustment]:
    """Helmert/Foerstner estimation with true group redundancies.

    Returns:
        The components, and the adjustment with the estimated weights.

    Raises:
        NotConvergedError: the factors do not settle.
    """
    base, groups = adjustment.problem, _groups_of(adjustment.problem)
    if not groups.names:
        return (), adjustment
    if len(groups.names) == 1:
        return _only_one(adjustment, groups)
    current, rounds = adjustment, _Rounds(len(groups.names))
    for _ in range(_MAX_ROUNDS):
        sums, redundancies = _shares(current, groups)
        rounds.give_up((redundancies < _NO_REDUNDANCY) | (rounds.factors < _FLOOR))
        change = np.sqrt(np.where(rounds.usable, sums / np.where(rounds.usable, redundancies, 1.0), 1.0))
        if np.abs(change - 1.0).max() <= _SETTLED and not rounds.gave_up_just_now:
            return _components(base, groups, rounds.factors, redundancies, rounds.usable), current
        current = refine(_reweighted(base, groups, rounds.next(np.maximum(change, _FLOOR))), current)
    raise NotConvergedError("the variance components do not settle; merge groups of small redundancy")


def _only_one(adjustment: Adjustment, groups: _Groups) -> tuple[tuple[Component, ...], Adjustment]:
    """One group alone: its factor is the ratio of the estimated to the a-priori sigma0."""
    factors = np.array([max(adjustment.ratio, _FLOOR)])
    problem = _reweighted(adjustment.problem, groups, factors)
    redundancies = np.array([float(adjustment.redundancy)])
    components = _components(adjustment.problem, groups, factors, redundancies, redundancies > 0.0)
    return components, refine(problem, adjustment)


class _Rounds:
    """The factors from round to round, extrapolated (Anderson) because groups of small redundancy creep."""

    def __init__(self, count: int):
        self.factors = np.ones(count)
        self.usable = np.ones(count, dtype=bool)
        self.gave_up_just_now = False
        self._points: list[Floats] = []
        self._moves: list[Floats] = []

    def give_up(self, hopeless: Flags) -> None:
        """Keep some groups at their a-priori sigmas from now on: they are not controlled, or less so in every round."""
        self.gave_up_just_now = bool(np.any(hopeless & self.usable & (self.factors != 1.0)))
        self.usable &= ~hopeless
        if self.gave_up_just_now:
            self.factors = np.where(self.usable, self.factors, 1.0)
            self._points, self._moves = [], []

    def next(self, change: Floats) -> Floats:
        """New factors from the changes of the present ones that the last round estimated."""
        point, move = np.log(self.factors), np.where(self.usable, np.log(change), 0.0)
        self._points = [*self._points, point][-_MEMORY:]
        self._moves = [*self._moves, move][-_MEMORY:]
        target = point + move
        if len(self._points) > 1:
            slopes = np.diff(np.array(self._moves), axis=0).T
            steps = np.diff(np.array(self._points), axis=0).T
            weights, *_ = np.linalg.lstsq(slopes, move, rcond=1e-8)
            # no further than a factor of e beyond the plain step
            target = target - np.clip((steps + slopes) @ weights, -1.0, 1.0)
        self.factors = np.where(self.usable, np.exp(target), self.factors)
        return self.factors


def estimate_by_paper(adjustment: Adjustment) -> tuple[tuple[Component, ...], Adjustment]:
    """Equations D5a, D5b as printed: r1 the redundancy of all, r2 = n2 - 7.

    Raises:
        BadInputError: not more than 7 control points.
        NotConvergedError: the weights do not settle.
    """
    base = adjustment.problem
    control = base.relations.rows(Kind.CONTROL)
    r2 = len(control) // 3 - _PAPER_CONDITIONS
    if r2 <= 0:
        raise BadInputError(
            f"equation D5b needs more than {_PAPER_CONDITIONS} control points, the network has {len(control) // 3}; "
            'survey more, or set "reweight": true for true group redundancies'
        )
    groups = _groups_of(base)
    is_control = np.array([name == "control" for name in groups.names])
    current, relative = adjustment, 1.0  # relative: control factor in units of the image factor
    for _ in range(_MAX_ROUNDS):
        sigma0 = current.ratio  # D5a
        sum_control = float(np.sum(current.equations.relations.v[control] ** 2)) * relative**2
        improved = np.sqrt(sum_control / r2) / sigma0  # D5b
        settled = abs(improved / relative - 1.0) <= _SETTLED
        if settled:
            factors = np.where(is_control, relative, 1.0) * sigma0
            redundancies = np.where(is_control, float(r2), float(current.redundancy))
            components = _components(base, groups, factors, redundancies, factors > 0.0)
            return components, refine(_reweighted(base, groups, factors), current)
        relative = max(improved, _FLOOR)
        current = refine(_reweighted(base, groups, np.where(is_control, relative, 1.0)), current)
    raise NotConvergedError('the weights of D5 do not settle; set "reweight": true for true group redundancies')


def _groups_of(problem: Problem) -> _Groups:
    observed = problem.network.observations
    present = np.unique(observed.group)
    image_names = [observed.groups[i] for i in present]
    kinds = np.unique(problem.relations.kind)
    names = tuple(image_names) + tuple(Kind(kind).name.lower() for kind in kinds)
    image = np.searchsorted(present, observed.group[problem.order])
    return _Groups(names, image, len(image_names) + np.searchsorted(kinds, problem.relations.kind))


def _shares(adjustment: Adjustment, groups: _Groups) -> tuple[Floats, Floats]:
    """Sum of squared whitened residuals and redundancy of each group."""

    def total(image: Floats, relation: Floats) -> Floats:
        count = len(groups.names)
        by_image = np.bincount(groups.image, image.sum(axis=1), count)
        return np.asarray(by_image + np.bincount(groups.relation, relation, count), dtype=float)

    equations, controlled = adjustment.equations, adjustment.controlled
    sums = total(equations.v**2, equations.relations.v**2)
    return sums, total(controlled.image_numbers, controlled.relation)


def _reweighted(problem: Problem, groups: _Groups, factors: Floats) -> Problem:
    return replace(
        problem,
        sigma=problem.sigma * factors[groups.image][:, None],
        relation_sigma=problem.relation_sigma * factors[groups.relation],
    )


def _components(
    problem: Problem, groups: _Groups, factors: Floats, redundancies: Floats, known: Flags
) -> tuple[Component, ...]:
    components = []
    for i, name in enumerate(groups.names):
        sigmas = np.concatenate(
            [problem.sigma[groups.image == i].ravel(), problem.relation_sigma[groups.relation == i]]
        )
        single = float(sigmas[0]) if np.all(sigmas == sigmas[0]) else None
        factor = float(factors[i]) if known[i] else None
        sigma = single * factor if single is not None and factor is not None else None
        components.append(Component(name, factor, sigma, float(redundancies[i])))
    return tuple(components)
