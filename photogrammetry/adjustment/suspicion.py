"""Suspicion: which observations are too bad for chance, and whether the data can tell which of them it is.

A suspect is accused only if it stays significant beside an error of any other observation. Those beside which it does
not are its rivals: each of them alone explains what it explains. The culprit, where there is one, is among the suspect
and its rivals but for a chance of `SINGLE_RISK`; so nobody is accused as long as there is a rival.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from photogrammetry.adjustment.adjustment import Adjustment
from photogrammetry.adjustment.blunders import Blunder, Observation
from photogrammetry.adjustment.hypotheses import Hypotheses, beside, effect_of, hypotheses_of
from photogrammetry.adjustment.state import Floats
from photogrammetry.adjustment.unknowns import Integers

#: Chance that anything at all is suspected in sound data; and never more than this for a single test (3.29 sigma).
FAMILY_RISK = 0.01
SINGLE_RISK = 0.001
#: With less redundancy than this, the a-priori sigmas are asked as well: a blunder hides in the estimated sigma0.
_SMALL_REDUNDANCY = 30
_NOISE = 1e-4  # sums of squares below this (in a-priori variances) are rounding
#: Of a large error so much may be left beside the culprit, because its effect is not linear.
_LINEAR = 0.05


def find_blunders(adjustment: Adjustment, family_risk: float = FAMILY_RISK) -> list[Blunder]:
    """Suspected gross errors, the largest test value first: that is the suspect, the others may be its consequences.

    Args:
        adjustment: an adjusted network.
        family_risk: chance that anything at all is suspected in sound data.
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


def significant(squares: Floats, parts: int, total: ArrayLike, freedom: ArrayLike, risk: float) -> NDArray[np.bool_]:
    """Which squared statistics are too large for chance.

    Args:
        squares: (h,) by what the square sum falls where an observation gets an error of its own.
        parts: degrees of freedom of each.
        total: square sum of all residuals in units of their a-priori sigmas; one, or one for each.
        freedom: its degrees of freedom.
        risk: chance that a sound observation is found.
    """
    squares, total, freedom = np.broadcast_arrays(squares, np.asarray(total, float), np.asarray(freedom, float))
    chosen = squares > _surely(parts, total, freedom, risk)
    open_ = ~chosen & (squares > _NOISE)  # the distributions are slow where there are thousands to be asked for
    chosen[open_] = _too_large(squares[open_], parts, total[open_], freedom[open_], risk)
    return np.asarray(chosen & (squares > _NOISE), dtype=bool)


def _too_large(squares: Floats, parts: int, total: Floats, freedom: Floats, risk: float) -> NDArray[np.bool_]:
    """By the variance that is left; with small redundancy by the a-priori sigmas too."""
    enough = freedom > parts
    left = np.where(enough, freedom - parts, 1.0)
    rest = np.maximum(total - squares, 1e-300) / left
    chosen = enough & (special.fdtrc(parts, left, squares / parts / rest) < risk)
    failed = (freedom <= _SMALL_REDUNDANCY) & (special.chdtrc(np.maximum(freedom, 1.0), total) < SINGLE_RISK)
    return np.asarray(chosen | (failed & (special.chdtrc(parts, squares) < risk)), dtype=bool)


def _surely(parts: int, total: Floats, freedom: Floats, risk: float) -> float:
    """A bound from which on a squared statistic is significant, whichever it is."""
    least = float(freedom.min(initial=np.inf)) - parts
    if not 0.0 < least < np.inf:
        return float(np.inf)
    return float(parts * special.fdtri(parts, least, 1.0 - risk) * total.max() / least)


def still_found(adjustment: Adjustment, suspect: Observation) -> bool:
    """Whether one observation alone, of which all others are taken for sound, is too bad for chance."""
    for family in hypotheses_of(adjustment):
        if family.kind is suspect.kind:
            chosen = family.index == suspect.index
            squares, total = family.signed[chosen] ** 2, adjustment.equations.square_sum
            return bool(significant(squares, family.parts, total, adjustment.redundancy, SINGLE_RISK).any())
    return False


def _blunder(adjustment: Adjustment, families: list[Hypotheses], family: Hypotheses, place: int) -> Blunder:
    """Estimate a blunder and find those that it may be mistaken for."""
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
    """Standard deviations in use of flat rows."""
    sigma = np.concatenate([adjustment.problem.sigma.ravel(), adjustment.problem.relation_sigma])
    return np.asarray(sigma[rows])
