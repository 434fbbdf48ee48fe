"""Gross errors: which observation is wrong, by how much, and whether the data can tell at all.

An alternative hypothesis gives one observation (an image point, a control point, a distance, a difference) an error
of its own. Its estimate is -R^+ v of the observation's block, and T = v^T R^+ v is what vTPv falls by. Two hypotheses
whose effects on the residuals point the same way cannot be told apart, whatever their size: then nobody is accused.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy import special

from photogrammetry.adjustment.adjustment import Adjustment
from photogrammetry.adjustment.relations import Kind
from photogrammetry.adjustment.state import Floats
from photogrammetry.adjustment.unknowns import NONE, Integers

#: Chance that anything at all is suspected in sound data; and never more than this for a single test (3.29 sigma).
FAMILY_RISK = 0.01
SINGLE_RISK = 0.001
#: With less redundancy than this, the a-priori sigmas are asked as well: a blunder hides in the estimated sigma0.
_SMALL_REDUNDANCY = 30
_UNCONTROLLED = 1e-6  # eigenvalues of R below this are zero
_NOISE = 1e-4  # sums of squares below this (in a-priori variances) are rounding
_SAME = 1.0 - 1e-6  # squared correlation of test statistics from which on they are the same
_NEEDED = 1.96  # test value that a suspect must keep beside another one; with less the other one alone will do


class BlunderKind(StrEnum):
    """Kind of observation."""

    IMAGE = "image"
    CONTROL = "control"
    DISTANCE = "distance"
    DIFFERENCE = "difference"


@dataclass(frozen=True, slots=True)
class Observation:
    """One observation: index of the image observation, control point, distance or difference in the network."""

    kind: BlunderKind
    index: int


@dataclass(frozen=True, slots=True, eq=False)
class Blunder:
    """A suspected gross error.

    Attributes:
        suspect: the observation with the largest test value.
        estimate: observed - true, one number per coordinate, metric frame, in the observation's unit.
        w: test value; of an image point that of its worse coordinate.
        locatable: whether the data can tell that it is this one.
        candidates: those that it may be instead, the suspect first; empty if it is locatable.
        margin: test value that it keeps beside its strongest rival; 0 if that explains everything.
    """

    suspect: Observation
    estimate: Floats
    w: float
    locatable: bool
    candidates: tuple[Observation, ...]
    margin: float


@dataclass(frozen=True, slots=True, eq=False)
class _Hypotheses:
    """All alternative hypotheses of one kind.

    Attributes:
        kind: kind.
        index: (h,) what they are about, in the network.
        rows: (h, q) rows among the flat whitened residuals.
        inverse: (h, q, q) pseudo-inverse of R's blocks.
        v: (h, q) whitened residuals.
        drop: (h,) what the square sum falls by.
        signed: (h,) the statistic that decides: the worse coordinate for images, the root of the drop for control.
        tested: (h,) its square.
        parts: degrees of freedom of that statistic.
    """

    kind: BlunderKind
    index: Integers
    rows: Integers
    inverse: Floats
    v: Floats
    drop: Floats
    signed: Floats
    tested: Floats
    parts: int


def find_blunders(adjustment: Adjustment) -> list[Blunder]:
    """Suspected gross errors, the largest test value first: that is the suspect, the others may be its consequences."""
    if adjustment.redundancy <= 0:
        return []
    families = _hypotheses(adjustment)
    tests = sum(family.tested.size * (2 if family.kind is BlunderKind.IMAGE else 1) for family in families)
    risk = min(SINGLE_RISK, FAMILY_RISK / max(tests, 1))
    found = [
        (family, int(place))
        for family in families
        for place in np.flatnonzero(
            significant(family.tested, family.parts, adjustment.equations.square_sum, adjustment.redundancy, risk)
        )
    ]
    found.sort(key=lambda item: -float(item[0].tested[item[1]]))
    blunders: list[Blunder] = []
    explained: set[Observation] = set()
    for family, place in found:
        blunder = _blunder(adjustment, families, family, place)
        if blunder.suspect in explained and not blunder.locatable:
            continue
        explained.update(blunder.candidates)
        blunders.append(blunder)
    return blunders


def significant(squares: Floats, parts: int, total: float, freedom: int, risk: float) -> NDArray[np.bool_]:
    """Which squared statistics are too large for chance.

    Args:
        squares: (h,) by what the square sum falls where an observation gets an error of its own.
        parts: degrees of freedom of each.
        total: square sum of all residuals in units of their a-priori sigmas.
        freedom: its degrees of freedom.
        risk: chance that a sound observation is found.
    """
    chosen = np.zeros(len(squares), dtype=bool)
    if freedom > parts:
        rest = np.maximum(total - squares, 1e-300) / (freedom - parts)
        chosen = special.fdtrc(parts, freedom - parts, squares / parts / rest) < risk
    if freedom <= _SMALL_REDUNDANCY and special.chdtrc(freedom, total) < SINGLE_RISK:
        chosen = chosen | (special.chdtrc(parts, squares) < risk)
    return np.asarray(chosen & (squares > _NOISE), dtype=bool)


def _hypotheses(adjustment: Adjustment) -> list[_Hypotheses]:
    """Every single observation of the network as an alternative."""
    problem, numbers = adjustment.problem, adjustment.controlled
    n = len(problem.image)
    v_relations, families = adjustment.equations.relations.v, []
    if n:
        blocks, v = numbers.image, adjustment.equations.v
        r = np.maximum(numbers.image_numbers, 0.0)
        single = np.where(r > _UNCONTROLLED, v / np.sqrt(np.where(r > _UNCONTROLLED, r, 1.0)), 0.0)
        worse = np.argmax(np.abs(single), axis=1)[:, None]
        signed = np.take_along_axis(single, worse, axis=1)[:, 0]
        rows = np.arange(2 * n).reshape(n, 2)
        families.append(_family(BlunderKind.IMAGE, problem.order, rows, blocks, v, signed))
    control = problem.relations.rows(Kind.CONTROL).reshape(-1, 3)
    if len(control):
        index = problem.relations.item[control[:, 0]]
        blocks = _control_blocks(adjustment, control)
        families.append(_family(BlunderKind.CONTROL, index, 2 * n + control, blocks, v_relations[control]))
    for kind, name in ((Kind.DISTANCE, BlunderKind.DISTANCE), (Kind.DIFFERENCE, BlunderKind.DIFFERENCE)):
        rows = problem.relations.rows(kind)[:, None]
        if len(rows):
            blocks, v = numbers.relation[rows][:, :, None], v_relations[rows]
            r = np.maximum(numbers.relation[rows[:, 0]], _UNCONTROLLED)
            families.append(
                _family(name, problem.relations.item[rows[:, 0]], 2 * n + rows, blocks, v, v[:, 0] / r**0.5)
            )
    return families


def _family(
    kind: BlunderKind, index: Integers, rows: Integers, blocks: Floats, v: Floats, signed: Floats | None = None
) -> _Hypotheses:
    values, vectors = np.linalg.eigh(blocks)
    inverse_values = np.where(values > _UNCONTROLLED, 1.0 / np.where(values > _UNCONTROLLED, values, 1.0), 0.0)
    inverse = (vectors * inverse_values[:, None, :]) @ vectors.transpose(0, 2, 1)
    drop = np.einsum("ha,hab,hb->h", v, inverse, v)
    as_a_whole = signed is None
    sign = np.sqrt(drop) if signed is None else signed
    return _Hypotheses(kind, index, rows, inverse, v, drop, sign, sign**2, v.shape[1] if as_a_whole else 1)


def _control_blocks(adjustment: Adjustment, rows: Integers) -> Floats:
    """Blocks of R of whole control points, (h, 3, 3)."""
    relations = adjustment.equations.relations
    columns, values = relations.columns[rows, 0], relations.values[rows, 0]
    q = adjustment.cofactors[columns[:, :, None], columns[:, None, :]]
    return np.asarray(np.eye(3) - values[:, :, None] * q * values[:, None, :])


def _blunder(adjustment: Adjustment, families: list[_Hypotheses], family: _Hypotheses, place: int) -> Blunder:
    """Estimate a blunder and find those that it may be mistaken for."""
    suspect = Observation(family.kind, int(family.index[place]))
    estimate = -family.inverse[place] @ family.v[place]
    effect = _effect(adjustment, family.rows[place], estimate)
    freedom = adjustment.redundancy - family.v.shape[1]
    rest = adjustment.equations.square_sum - family.drop[place]
    clean = np.sqrt(rest / freedom) if freedom > 0 and rest > 0.0 else 1.0
    rivals: list[tuple[float, Observation]] = []
    margin = np.inf
    size = np.sqrt(family.drop[place])
    for other in families:
        felt = effect[other.rows]
        alike = np.einsum("ha,hab,hb->h", felt, other.inverse, felt) / size**2
        # What the suspect still explains once the other one is let go: nothing, if that one is the culprit.
        shared = np.einsum("ha,hab,hb->h", felt, other.inverse, other.v) / size
        left = np.abs(size + shared) / np.sqrt(np.maximum(1.0 - alike, 1e-12)) / clean
        left[alike > _SAME] = 0.0
        if other is family:
            left[place] = np.inf
        margin = min(margin, float(left.min()))
        indices = np.flatnonzero(left < _NEEDED)
        rivals += [(-float(other.drop[i]), Observation(other.kind, int(other.index[i]))) for i in indices]
    rivals.sort(key=lambda rival: (rival[0], rival[1].kind, rival[1].index))
    candidates = (suspect, *(observation for _, observation in rivals)) if rivals else ()
    scale = _sigmas(adjustment, family.rows[place])
    w = float(family.signed[place]) / adjustment.ratio
    return Blunder(suspect, estimate * scale, w, not rivals, candidates, margin)


def _effect(adjustment: Adjustment, rows: Integers, error: Floats) -> Floats:
    """R E error: what an error of some observations does to all residuals (flat, whitened), sign reversed."""
    problem, equations = adjustment.problem, adjustment.equations
    n = len(problem.image)
    columns, slopes = observation_row(adjustment, rows)
    pulled = np.append(adjustment.cofactors[:, columns] @ (slopes.T @ error), 0.0)  # column -1: nothing
    on_global = pulled[problem.global_columns()][problem.image]
    on_point = pulled[problem.unknowns.point][problem.point]
    image = np.einsum("nrk,nk->nr", equations.by_global, on_global)
    image += np.einsum("nrk,nk->nr", equations.by_point, on_point)
    relations = equations.relations
    other = np.einsum("mk,mk->m", relations.values, pulled[relations.columns])
    effect = -np.concatenate([image.reshape(2 * n), other])
    effect[rows] += error
    return effect


def observation_row(adjustment: Adjustment, rows: Integers) -> tuple[Integers, Floats]:
    """Columns (w,) and derivatives (q, w) of some observations (flat rows of one observation)."""
    problem, equations = adjustment.problem, adjustment.equations
    n = len(problem.image)
    if rows[0] < 2 * n:
        i = int(rows[0]) // 2
        columns = np.append(problem.global_columns()[problem.image[i]], problem.unknowns.point[problem.point[i]])
        slopes = np.hstack([equations.by_global[i], equations.by_point[i]])
    else:
        picked = rows - 2 * n
        columns = np.unique(equations.relations.columns[picked])
        slopes = np.zeros((len(rows), len(columns)))
        for row, relation in enumerate(picked):
            places = np.searchsorted(columns, equations.relations.columns[relation])
            np.add.at(slopes[row], places, equations.relations.values[relation])
    used = columns != NONE
    return columns[used], slopes[:, used]


def _sigmas(adjustment: Adjustment, rows: Integers) -> Floats:
    """Standard deviations in use of flat rows."""
    sigma = np.concatenate([adjustment.problem.sigma.ravel(), adjustment.problem.relation_sigma])
    return np.asarray(sigma[rows])
