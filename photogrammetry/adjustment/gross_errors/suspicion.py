"""Linear tests: which observations have significant errors, and whether the data show which observation is wrong.

The suspect is the observation with the largest test value. Its rivals are the observations whose error, if assumed,
makes the suspect insignificant: each of them alone explains the residuals as well. If one observation is wrong, it is
the suspect or a rival, but for a probability of `SINGLE_RISK`. So the suspect is only accused if it has no rival.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from photogrammetry.adjustment.gross_errors.blunders import Blunder, Observation
from photogrammetry.adjustment.gross_errors.hypotheses import Hypotheses, beside, effect_of, hypotheses_of
from photogrammetry.adjustment.solution.adjustment import Adjustment
from rig.arrays import Flags, Floats, Integers

#: Probability that all tests together suspect anything in sound data.
FAMILY_RISK = 0.01
#: Upper limit of the probability that a single test does (3.29 sigma).
SINGLE_RISK = 0.001
#: With less redundancy a blunder hides in the estimated sigma0, so the tests use the a-priori sigmas as well.
_SMALL_REDUNDANCY = 30
_NOISE = 1e-4  # sums of squares below this (in a-priori variances) are rounding
#: Part of a large error that may remain with the culprit eliminated, because its effect is not linear.
_LINEAR = 0.05


def find_blunders(adjustment: Adjustment, family_risk: float = FAMILY_RISK) -> list[Blunder]:
    """Suspected gross errors, the largest test value first; the others may be consequences of the first.

    Args:
        adjustment: an adjusted network.
        family_risk: probability that all tests together suspect anything in sound data.
    """
    if adjustment.redundancy <= 0:
        return []
    families = hypotheses_of(adjustment)
    risk = min(SINGLE_RISK, family_risk / max(sum(family.tests for family in families), 1))
    found = []
    for family in families:
        total, freedom = adjustment.equations.square_sum, adjustment.redundancy
        too_large = significant(family.signed**2, family.parts, total, freedom, risk)
        found += [(family, int(place)) for place in np.flatnonzero(too_large)]
    found.sort(key=lambda item: -abs(float(item[0].signed[item[1]])))
    blunders: list[Blunder] = []
    explained: set[Observation] = set()
    for family, place in found:
        blunder = _blunder(adjustment, families, family, place)
        if blunder.suspect in explained and not blunder.locatable:
            continue
        explained.update(blunder.candidates)
        blunders.append(blunder)
    return blunders


def significant(squares: Floats, parts: int, total: ArrayLike, freedom: ArrayLike, risk: float) -> Flags:
    """Which squared test values are significant.

    Args:
        squares: (h,) by how much an error of the observation lowers the square sum.
        parts: degrees of freedom of each.
        total: square sum of all residuals in units of their a-priori sigmas; one, or one for each.
        freedom: its degrees of freedom.
        risk: probability that the test of a sound observation is significant.
    """
    squares, total, freedom = np.broadcast_arrays(squares, np.asarray(total, float), np.asarray(freedom, float))
    chosen = squares > _surely(parts, total, freedom, risk)
    open_ = ~chosen & (squares > _NOISE)  # only these: computing the distributions is slow for thousands of tests
    chosen[open_] = _too_large(squares[open_], parts, total[open_], freedom[open_], risk)
    return np.asarray(chosen & (squares > _NOISE), dtype=bool)


def _too_large(squares: Floats, parts: int, total: Floats, freedom: Floats, risk: float) -> Flags:
    """F-test against the variance of the other residuals; with small redundancy the chi-square test as well."""
    enough = freedom > parts
    left = np.where(enough, freedom - parts, 1.0)
    rest = np.maximum(total - squares, 1e-300) / left
    chosen = enough & (special.fdtrc(parts, left, squares / parts / rest) < risk)
    failed = (freedom <= _SMALL_REDUNDANCY) & (special.chdtrc(np.maximum(freedom, 1.0), total) < SINGLE_RISK)
    return np.asarray(chosen | (failed & (special.chdtrc(parts, squares) < risk)), dtype=bool)


def _surely(parts: int, total: Floats, freedom: Floats, risk: float) -> float:
    """A bound beyond which every squared test value is significant."""
    least = float(freedom.min(initial=np.inf)) - parts
    if not 0.0 < least < np.inf:
        return float(np.inf)
    return float(parts * special.fdtri(parts, least, 1.0 - risk) * total.max() / least)


def still_found(adjustment: Adjustment, suspect: Observation) -> bool:
    """Whether one observation is significant if all others are taken as sound."""
    for family in hypotheses_of(adjustment):
        if family.kind is suspect.kind:
            chosen = family.index == suspect.index
            squares, total = family.signed[chosen] ** 2, adjustment.equations.square_sum
            return bool(significant(squares, family.parts, total, adjustment.redundancy, SINGLE_RISK).any())
    return False


def _blunder(adjustment: Adjustment, families: list[Hypotheses], family: Hypotheses, place: int) -> Blunder:
    """Estimate the error of a suspect and find its rivals."""
    suspect = family.observation(place)
    effect = effect_of(adjustment, family.rows[place])
    size = float(np.sqrt(family.drop[place]))
    rivals: list[tuple[float, Observation]] = []
    for other in families:
        left = np.maximum(np.abs(beside(family, place, effect, other)) - _LINEAR * size, 0.0)
        total = adjustment.equations.square_sum - other.drop
        freedom = adjustment.redundancy - other.rank
        explains = ~significant(left**2, family.parts, total, freedom, SINGLE_RISK)
        if other is family:
            explains[place] = False
        rivals += [(-float(other.drop[i]), other.observation(int(i))) for i in np.flatnonzero(explains)]
    rivals.sort(key=lambda rival: (rival[0], rival[1].kind, rival[1].index))
    candidates = (suspect, *(observation for _, observation in rivals)) if rivals else ()
    estimate = -family.inverse[place] @ family.v[place] * _sigmas(adjustment, family.rows[place])
    return Blunder(suspect, estimate, float(family.signed[place]) / adjustment.ratio, not rivals, candidates)


def _sigmas(adjustment: Adjustment, rows: Integers) -> Floats:
    """Standard deviations in use of some flat rows."""
    sigma = np.concatenate([adjustment.problem.sigma.ravel(), adjustment.problem.relation_sigma])
    return np.asarray(sigma[rows])
