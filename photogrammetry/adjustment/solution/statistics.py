"""Redundancy numbers, w-tests and what a network can detect (Baarda, Foerstner).

In units of their standard deviations the residuals are v = -R e with R = I - J Q J^T; the redundancy numbers are the
diagonal of R, and their sum is the network's redundancy.
"""

from dataclasses import dataclass

import numpy as np
from scipy import special

from photogrammetry.adjustment.equations.problem import Equations, Problem
from rig.arrays import Floats

#: An observation with a smaller redundancy number is not controlled: no test, no minimal detectable blunder.
UNCONTROLLED = 1e-8
#: Non-centrality that a blunder needs to be found: significance 0.1 %, power 80 % (Baarda).
NON_CENTRALITY = 4.13
#: Redundant observations that the a-priori variance is worth: sigmas are misjudged by a factor of two at times.
A_PRIORI = 4
#: With so few redundant observations chance makes the estimated sigma0 so small that five sigmas are none.
_FEW_REDUNDANT = 30
#: Probability of a sigma0 so small that chance does not explain it: beyond five sigmas, on one side.
_NO_CHANCE = 2.9e-7


@dataclass(frozen=True, slots=True, eq=False)
class Redundancy:
    """Diagonal blocks of R, whitened.

    Attributes:
        image: (n, 2, 2), in the problem's order.
        relation: (m,).
    """

    image: Floats
    relation: Floats

    @property
    def image_numbers(self) -> Floats:
        """Redundancy numbers of the image coordinates, (n, 2)."""
        return np.diagonal(self.image, axis1=1, axis2=2)

    @property
    def total(self) -> float:
        """Their sum: the redundancy of the network."""
        return float(self.image_numbers.sum() + self.relation.sum())


def redundancy(problem: Problem, equations: Equations, cofactors: Floats) -> Redundancy:
    """Redundancy of every observation.

    Args:
        problem: the network made ready.
        equations: linearised at the solution.
        cofactors: (u, u), in any datum.
    """
    if not cofactors.size:  # everything is constant: nothing is explained
        return Redundancy(np.tile(np.eye(2), (len(problem.image), 1, 1)), np.ones(len(problem.relations)))
    columns = problem.global_columns()
    point = problem.unknowns.point[problem.point]  # (n, 3); constants have zero derivatives
    by_global, by_point = equations.by_global, equations.by_point
    mixed = cofactors[columns[problem.image][:, :, None], point[:, None, :]]
    onto_point = by_point @ cofactors[point[:, :, None], point[:, None, :]] + 2.0 * (by_global @ mixed)
    explained = onto_point @ by_point.transpose(0, 2, 1)
    explained = 0.5 * (explained + explained.transpose(0, 2, 1))
    for image, (begin, stop) in enumerate(zip(problem.start[:-1], problem.start[1:], strict=True)):
        if begin < stop:
            where, slopes = columns[image], by_global[begin:stop]
            explained[begin:stop] += slopes @ cofactors[where[:, None], where] @ slopes.transpose(0, 2, 1)
    relation = equations.relations
    block = cofactors[relation.columns[:, :, None], relation.columns[:, None, :]]
    seen = np.einsum("mi,mij,mj->m", relation.values, block, relation.values)
    return Redundancy(np.eye(2) - explained, 1.0 - seen)


def posterior_scale(square_sum: float, redundancy: int) -> float:
    """The factor from the root of a cofactor to a standard deviation, in a-priori sigma0.

    It is the estimated sigma0. Two redundant observations give one of a fifth in four of a hundred networks whose
    sigmas are right, and an error of one sigma would be one of five. So where few are redundant, and chance explains
    that the estimate is small, the a-priori variance counts as `A_PRIORI` observations beside them.

    Args:
        square_sum: of the residuals, in a-priori variances.
        redundancy: of the network; 0: the a-priori sigmas stand.
    """
    if redundancy <= 0:
        return 1.0
    small = square_sum < redundancy <= _FEW_REDUNDANT
    if small and special.chdtr(redundancy, square_sum) > _NO_CHANCE:
        return float(np.sqrt((square_sum + A_PRIORI) / (redundancy + A_PRIORI)))
    return float(np.sqrt(square_sum / redundancy))


def w_values(v: Floats, r: Floats, sigma0: float) -> Floats:
    """Test values w = v / (sigma0 sqrt(r)) of whitened residuals; NaN where nothing controls the observation.

    Args:
        v: residuals in units of their standard deviations.
        r: redundancy numbers, same shape.
        sigma0: ratio of the estimated to the a-priori sigma0.
    """
    controlled = r > UNCONTROLLED
    size = np.sqrt(np.where(controlled, r, 1.0)) * sigma0
    w: Floats = np.where(controlled & (size > 0.0), v / np.where(size > 0.0, size, 1.0), np.nan)
    return w


def minimal_detectable(sigma: Floats, r: Floats) -> Floats:
    """Minimal detectable blunder of single observations, in their unit (Baarda); infinite where uncontrolled.

    Args:
        sigma: standard deviations.
        r: redundancy numbers, same shape.
    """
    controlled = r > UNCONTROLLED
    size: Floats = np.where(controlled, NON_CENTRALITY * sigma / np.sqrt(np.where(controlled, r, 1.0)), np.inf)
    return size


def correlation(covariance: Floats) -> Floats:
    """Correlation matrix (k, k) of a covariance matrix."""
    sigma = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    return np.asarray(covariance / np.maximum(np.outer(sigma, sigma), 1e-300))
