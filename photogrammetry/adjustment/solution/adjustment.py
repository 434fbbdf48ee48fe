"""Adjusts a network with given weights: optimum, covariance, redundancy, test values."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from photogrammetry.adjustment.equations.problem import Equations, Problem, build_problem
from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.equations.unknowns import State, state_of
from photogrammetry.adjustment.solution.datum import (
    DatumError,
    FreeDatum,
    align,
    datum_points,
    inner_operator,
    s_transform,
)
from photogrammetry.adjustment.solution.normals import SingularError, build_normals, factorise
from photogrammetry.adjustment.solution.rank import check_rank
from photogrammetry.adjustment.solution.solver import solve
from photogrammetry.adjustment.solution.statistics import (
    Redundancy,
    correlation,
    minimal_detectable,
    posterior_scale,
    redundancy,
    w_values,
)
from photogrammetry.network.diagnosis import Defect, DefectKind, NotConvergedError, NotSolvableError
from photogrammetry.network.model import Network
from rig.arrays import Floats, Integers
from rig.phrase import phrase

#: Sigmas: a smaller parameter is not significantly different from zero.
_SIGNIFICANT = 1.96
#: Below this reciprocal condition at the optimum the rank is analysed again.
_DOUBTFUL = 1e-11
#: The redundancy numbers add up to the redundancy; a larger difference means that rounding has spoilt the solution.
_LOST = 0.01
#: Part of scale in the free motions of a network (rad, logarithm) that is rounding.
_NO_SCALE = 1e-6
#: Stands for the unit of lengths in a network without a scale.
UNSCALED = "units without a scale"


@dataclass(frozen=True, slots=True)
class Parameter:
    """An estimated parameter of a camera's interior orientation with its a-posteriori standard deviation."""

    name: str
    value: float
    sigma: float

    @property
    def insignificant(self) -> bool:
        """Whether it may as well be zero (5 % level); the question does not make sense for c."""
        return self.name != "c" and abs(self.value) < _SIGNIFICANT * self.sigma


@dataclass(frozen=True, slots=True, eq=False)
class Adjustment:
    """An adjusted network.

    Attributes:
        problem: the network as adjusted, with columns and weights.
        state: adjusted values.
        iterations: steps taken.
        free: the free motions of a free network (none otherwise).
        equations: observation equations at the solution, whitened.
        cofactors: (u, u), Q of all unknowns in the chosen datum; unknowns by `problem.unknowns`.
        controlled: redundancy of every observation.
        cautious: sigmas of few redundant observations are not shrunk by chance (`posterior_scale`); else they carry the
            estimated sigma0 in any case.
    """

    problem: Problem
    state: State
    iterations: int
    free: FreeDatum
    equations: Equations
    cofactors: Floats
    controlled: Redundancy
    cautious: bool = False

    @property
    def network(self) -> Network:
        """The network that was adjusted, with the observed values."""
        return self.problem.network

    @property
    def redundancy(self) -> int:
        """Observations - unknowns + datum conditions."""
        return self.problem.n_observations - self.problem.unknowns.count + self.free.defect

    @property
    def scale_is_free(self) -> bool:
        """Whether nothing observed gives the network its size."""
        directions = np.abs(self.free.directions[3:])
        return bool(directions[3].max(initial=0.0) > _NO_SCALE * directions.max(initial=0.0))

    @property
    def length_unit(self) -> str:
        """The unit of lengths, for people; none without a scale."""
        return UNSCALED if self.scale_is_free else self.network.length_unit

    @property
    def ratio(self) -> float:
        """Estimated / a-priori sigma0; 1 where nothing is redundant."""
        return float(np.sqrt(self.equations.square_sum / self.redundancy)) if self.redundancy else 1.0

    @property
    def scale(self) -> float:
        """The factor from the root of a cofactor to a standard deviation, in a-priori sigma0."""
        return posterior_scale(self.equations.square_sum, self.redundancy) if self.cautious else self.ratio

    @property
    def sigma0(self) -> float | None:
        """Estimated sigma0 in the unit of the file's; None without redundancy."""
        return self.ratio * self.network.sigma0 if self.redundancy else None

    @property
    def vtpv(self) -> float:
        """Weighted sum of squared residuals, weights (sigma0 / sigma)^2."""
        return self.equations.square_sum * self.network.sigma0**2

    def covariance(self, columns: Integers) -> Floats:
        """A-posteriori covariance of chosen unknowns, cross terms included: (..., k, k) for columns (..., k).

        Constants (column -1) have zeros.
        """
        if not self.cofactors.size:
            return np.zeros((*columns.shape, columns.shape[-1]))
        block = self.cofactors[columns[..., :, None], columns[..., None, :]] * self.scale**2
        known = columns >= 0
        return np.asarray(np.where(known[..., :, None] & known[..., None, :], block, 0.0), dtype=float)

    def sigmas(self, columns: Integers) -> Floats:
        """A-posteriori standard deviations of unknowns, same shape as `columns`; zero for constants."""
        variance = np.append(np.diagonal(self.cofactors), 0.0)[columns]
        return np.asarray(self.scale * np.sqrt(np.maximum(variance, 0.0)), dtype=float)

    def parameters(self, camera: int) -> tuple[list[Parameter], Floats]:
        """The estimated parameters of a camera (index), and their correlation matrix (k, k)."""
        columns = self.problem.unknowns.camera[camera]
        known = columns >= 0
        values = self.state.interior[camera, self.problem.unknowns.selection[known]]
        names, sigmas = self.network.cameras[camera].estimate, self.sigmas(columns[known])
        parameters = [
            Parameter(name, float(value), float(sigma))
            for name, value, sigma in zip(names, values, sigmas, strict=True)
        ]
        return parameters, correlation(self.covariance(columns[known]))

    def image_residuals(self) -> Floats:
        """Residuals adjusted - observed in the metric frame, image unit, problem's order: (n, 2)."""
        return self.equations.v * self.problem.sigma

    def image_w(self) -> Floats:
        """Test values of the image coordinates, problem's order: (n, 2); NaN where uncontrolled."""
        return w_values(self.equations.v, self.controlled.image_numbers, self.ratio)

    def image_detectable(self) -> Floats:
        """Minimal detectable blunder of the image coordinates, image unit: (n, 2); infinite where uncontrolled."""
        return minimal_detectable(self.problem.sigma * self.ratio, self.controlled.image_numbers)

    def relation_residuals(self) -> Floats:
        """Residuals of the other observations in their units: (m,)."""
        return self.equations.relations.v * self.problem.relation_sigma

    def relation_tests(self, kind: Kind) -> Iterator[tuple[int, int, float, float, float]]:
        """Of all relations of a kind: item and part (see `Relations`), residual, redundancy number, test value."""
        relations, w = self.problem.relations, self.relation_w()
        columns = (relations.item, relations.part, self.relation_residuals(), self.controlled.relation, w)
        for row in relations.rows(kind):
            item, part, *numbers = (column[row] for column in columns)
            v, r, test = (float(number) for number in numbers)
            yield int(item), int(part), v, r, test

    def relation_w(self) -> Floats:
        """Test values of the other observations: (m,)."""
        return w_values(self.equations.relations.v, self.controlled.relation, self.ratio)

    def relation_detectable(self) -> Floats:
        """Minimal detectable blunder of the other observations in their units: (m,)."""
        return minimal_detectable(self.problem.relation_sigma * self.ratio, self.controlled.relation)

    def in_datum(self, points: Integers) -> "Adjustment":
        """The same free network in the datum of inner constraints over other points (S-transformation).

        Values stay: the new datum points are where they are now. Only the cofactors change.

        Args:
            points: indices of the new datum points.

        Raises:
            DatumError: they do not define a datum.
        """
        moves, conditions = inner_operator(self.problem, self.state, self.free, points)
        return replace(self, cofactors=s_transform(self.cofactors, moves, conditions))


def adjust_once(network: Network, start: State | None = None) -> Adjustment:
    """Adjust with the weights as they are.

    Args:
        network: the network; its values are the observed ones where they have a sigma.
        start: start values; the network's own if left out.

    Returns:
        The adjusted network.

    Raises:
        NotSolvableError: a rank defect; says which unknowns and why.
        NotConvergedError: no optimum was reached.
        BadInputError: a start value is missing.
    """
    problem, start = build_problem(network), state_of(network) if start is None else start
    with only_sound_numbers():
        return _adjusted(problem, start, check_rank(problem, start).defect, start)


def refine(problem: Problem, adjustment: Adjustment) -> Adjustment:
    """Adjust the same network again with other weights, from where it was; the datum stays where it is.

    Raises:
        NotSolvableError, NotConvergedError: as `adjust_once`.
    """
    with only_sound_numbers():
        return _adjusted(problem, adjustment.state, adjustment.free.defect, adjustment.state)


@contextmanager
def only_sound_numbers() -> Iterator[None]:
    """Turn overflow, and datum points that become collinear during the iteration, into errors with a message."""
    try:
        with np.errstate(all="ignore"):
            yield
    except np.linalg.LinAlgError:
        text = "the numbers leave all bounds; check units and sigmas, or give start values"
        raise NotConvergedError(phrase("unconverged_bounds", text)) from None
    except DatumError as error:
        text = "the datum points fall onto a line ({missing} conditions short); choose others"
        said = phrase("defect_datum_line", text, missing=error.missing)
        raise NotSolvableError((Defect(DefectKind.DATUM, error.missing, said),)) from None


def _adjusted(problem: Problem, start: State, defect: int, target: State) -> Adjustment:
    """Solve, bring a free network into the datum next to `target`, and compute covariance and redundancy."""
    state, iterations, free = solve(problem, start, defect)
    points = datum_points(problem.network)
    if free.defect:
        state = align(problem, state, free, points, target.xyz)
    equations = problem.equations(state)
    cofactors = cofactors_at(problem, state, equations, free, points)
    controlled = redundancy(problem, equations, cofactors)
    adjusted = Adjustment(problem, state, iterations, free, equations, cofactors, controlled)
    if not abs(controlled.total - adjusted.redundancy) <= _LOST:
        text = (
            "the solution has lost its digits (the redundancy numbers do not add up); look for coordinates or sigmas "
            "that are out of all proportion"
        )
        raise NotConvergedError(phrase("unconverged_digits", text))
    return adjusted


def cofactors_at(problem: Problem, state: State, equations: Equations, free: FreeDatum, points: Integers) -> Floats:
    """Cofactors Q (u, u) of all unknowns in the datum of inner constraints over `points`."""
    normals = build_normals(problem, equations)
    moves, conditions = inner_operator(problem, state, free, points)
    try:
        factor = factorise(normals, moves / normals.scale[:, None])
    except SingularError:
        check_rank(problem, state)
        text = "at the optimum the network is singular to working precision; estimate fewer camera parameters"
        said = phrase("defect_singular", text)
        raise NotSolvableError((Defect(DefectKind.PARAMETERS, 0, said),)) from None
    if factor.condition < _DOUBTFUL:
        check_rank(problem, state)
    return s_transform(factor.cofactors(), moves, conditions)
