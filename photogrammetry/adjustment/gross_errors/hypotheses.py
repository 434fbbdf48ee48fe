"""Alternative hypotheses of the search for gross errors: one single observation is wrong.

In units of their standard deviations the residuals are v = -R e. The estimate of an error in the block k is
-R_kk^+ v_k; it lowers vTPv by T_k = v_k^T R_kk^+ v_k. With an error in block k eliminated, the residuals of block h are
v_h - R_hk R_kk^+ v_k, and their block of R is R_hh - R_hk R_kk^+ R_kh.
"""

from dataclasses import dataclass

import numpy as np

from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.equations.unknowns import NONE
from photogrammetry.adjustment.gross_errors.blunders import BlunderKind, Observation
from photogrammetry.adjustment.solution.adjustment import Adjustment
from rig.arrays import Floats, Integers

_UNCONTROLLED = 1e-6  # eigenvalues of R below this are zero


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """All alternative hypotheses of one kind.

    Attributes:
        kind: of the observations.
        index: (h,) of the observations in the network.
        rows: (h, q) rows among the flat whitened residuals.
        blocks: (h, q, q) of R.
        inverse: (h, q, q) their pseudo-inverses.
        rank: (h,) of the blocks.
        v: (h, q) whitened residuals.
        drop: (h,) by how much each lowers the square sum.
        signed: (h,) the test value with its sign, see `statistic`.
    """

    kind: BlunderKind
    index: Integers
    rows: Integers
    blocks: Floats
    inverse: Floats
    rank: Integers
    v: Floats
    drop: Floats
    signed: Floats

    @property
    def parts(self) -> int:
        """Degrees of freedom of the statistic."""
        return self.v.shape[1] if self.kind is BlunderKind.CONTROL else 1

    @property
    def tests(self) -> int:
        """Number of tests."""
        return self.v.size // self.parts

    def observation(self, place: int) -> Observation:
        """The observation of one hypothesis."""
        return Observation(self.kind, int(self.index[place]))


def hypotheses_of(adjustment: Adjustment) -> list[Hypotheses]:
    """One hypothesis for every observation of the network, by kinds."""
    problem, numbers = adjustment.problem, adjustment.controlled
    n, relations = len(problem.image), problem.relations
    others, families = adjustment.equations.relations.v, []
    if n:
        rows = np.arange(2 * n).reshape(n, 2)
        families.append(_family(BlunderKind.IMAGE, problem.order, rows, numbers.image, adjustment.equations.v))
    control = relations.rows(Kind.CONTROL).reshape(-1, 3)
    if len(control):
        index, blocks = relations.item[control[:, 0]], _control_blocks(adjustment, control)
        families.append(_family(BlunderKind.CONTROL, index, 2 * n + control, blocks, others[control]))
    for kind, name in ((Kind.DISTANCE, BlunderKind.DISTANCE), (Kind.DIFFERENCE, BlunderKind.DIFFERENCE)):
        single = relations.rows(kind)[:, None]
        if len(single):
            index, blocks = relations.item[single[:, 0]], numbers.relation[single][:, :, None]
            families.append(_family(name, index, 2 * n + single, blocks, others[single]))
    return families


def _family(kind: BlunderKind, index: Integers, rows: Integers, blocks: Floats, v: Floats) -> Hypotheses:
    values, vectors = np.linalg.eigh(blocks)
    controlled = values > _UNCONTROLLED
    inverse = (vectors * np.where(controlled, 1.0 / np.where(controlled, values, 1.0), 0.0)[:, None, :]) @ np.swapaxes(
        vectors, 1, 2
    )
    drop = np.einsum("ha,hab,hb->h", v, inverse, v)
    signed = statistic(kind, v, blocks, np.ones(len(v)))
    return Hypotheses(kind, index, rows, blocks, inverse, controlled.sum(axis=1), v, drop, signed)


def statistic(kind: BlunderKind, v: Floats, blocks: Floats, scale: Floats) -> Floats:
    """The test value of whitened residuals: of a control point as a whole, otherwise of the worse coordinate.

    Args:
        kind: of the observations.
        v: (h, q) residuals.
        blocks: (h, q, q) of R, or those with another error eliminated.
        scale: (h,) size that the blocks are compared with to decide whether they are zero.

    Returns:
        (h,); zero where the observation is not controlled.
    """
    if kind is BlunderKind.CONTROL:
        values, vectors = np.linalg.eigh(blocks)
        along = np.einsum("hab,ha->hb", vectors, v)
        controlled = values > _UNCONTROLLED * scale[:, None]
        squares = np.where(controlled, along**2 / np.where(controlled, values, 1.0), 0.0)
        return np.asarray(np.sqrt(squares.sum(axis=1)))
    r = np.diagonal(blocks, axis1=1, axis2=2)
    controlled = r > _UNCONTROLLED * scale[:, None]
    single = np.where(controlled, v / np.sqrt(np.where(controlled, r, 1.0)), 0.0)
    worse = np.argmax(np.abs(single), axis=1)[:, None]
    return np.asarray(np.take_along_axis(single, worse, axis=1)[:, 0])


def _control_blocks(adjustment: Adjustment, rows: Integers) -> Floats:
    """Blocks of R of whole control points, (h, 3, 3)."""
    relations = adjustment.equations.relations
    columns, values = relations.columns[rows, 0], relations.values[rows, 0]
    q = adjustment.cofactors[columns[:, :, None], columns[:, None, :]]
    return np.asarray(np.eye(3) - values[:, :, None] * q * values[:, None, :])


def beside(suspect: Hypotheses, place: int, effect: Floats, rivals: Hypotheses) -> Floats:
    """The suspect's test value with an error of each rival eliminated: (h,).

    Args:
        suspect: hypotheses of the suspect's kind.
        place: of the suspect among them.
        effect: (rows, q) of the suspect, see `effect_of`.
        rivals: h hypotheses.
    """
    felt = effect[rivals.rows]
    taken = rivals.inverse @ felt
    v = suspect.v[place] - np.einsum("hkq,hk->hq", taken, rivals.v)
    blocks = suspect.blocks[place] - np.swapaxes(felt, 1, 2) @ taken
    largest = float(np.linalg.norm(suspect.blocks[place], 2))
    return statistic(suspect.kind, v, blocks, np.full(len(v), largest))


def effect_of(adjustment: Adjustment, rows: Integers) -> Floats:
    """Columns of R (all rows, q): the change of all residuals by unit errors in the rows of one observation."""
    problem, equations = adjustment.problem, adjustment.equations
    n, width = len(problem.image), len(rows)
    columns, slopes = observation_row(adjustment, rows)
    pulled = np.vstack([adjustment.cofactors[:, columns] @ slopes.T, np.zeros((1, width))])  # column -1: constants
    image = equations.by_global @ pulled[problem.global_columns()][problem.image]
    image += equations.by_point @ pulled[problem.unknowns.point][problem.point]
    relations = equations.relations
    other = np.einsum("mk,mkq->mq", relations.values, pulled[relations.columns])
    effect = -np.concatenate([image.reshape(2 * n, width), other])
    effect[rows] += np.eye(width)
    return effect


def observation_row(adjustment: Adjustment, rows: Integers) -> tuple[Integers, Floats]:
    """Columns (w,) and derivatives (q, w) of one observation, given by its flat rows (q,)."""
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
