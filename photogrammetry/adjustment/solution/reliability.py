"""External reliability: what errors of the size that the tests just miss do to the result (Baarda)."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.statistics import minimal_detectable
from rig.arrays import Floats, Integers


@dataclass(frozen=True, slots=True, eq=False)
class Effects:
    """The largest displacement of a point or projection centre by each observation's minimal detectable blunder.

    Attributes:
        length: length unit; infinite where nothing controls the observation.
        place: index of the point, or number of points + index of the image.
    """

    length: Floats
    place: Integers


@dataclass(frozen=True, slots=True, eq=False)
class Reliability:
    """External reliability of all observations.

    Attributes:
        image: of the image coordinates, (n, 2), problem's order.
        relation: of the other observations, (m,).
    """

    image: Effects
    relation: Effects


def reliability(a: Adjustment) -> Reliability:
    """What each observation does to points and projection centres with an error that the tests just miss.

    A free network's displacements are those in its datum.
    """
    unknowns, equations, start = a.problem.unknowns, a.equations, a.problem.start
    targets = np.vstack((unknowns.point, unknowns.pose[:, :3]))
    place = np.flatnonzero(targets[:, 0] >= 0)
    onto = targets[place].ravel()
    point, columns = unknowns.point[a.problem.point], a.problem.global_columns()
    one = np.ones(1)
    blunder = minimal_detectable(one, a.controlled.image_numbers) * a.ratio
    length, where = np.zeros(blunder.shape), np.zeros(blunder.shape, dtype=np.intp)
    for i, (begin, stop) in enumerate(pairwise(start)):
        if begin < stop and len(place):
            rows = slice(begin, stop)
            shifts = equations.by_global[rows] @ a.cofactors[np.ix_(columns[i], onto)]
            shifts += equations.by_point[rows] @ a.cofactors[point[rows][:, :, None], onto]
            length[rows], where[rows] = _largest(shifts, place)
    relation, by_relation = equations.relations, minimal_detectable(one, a.controlled.relation) * a.ratio
    far, at = np.zeros(len(by_relation)), np.zeros(len(by_relation), dtype=np.intp)
    if len(by_relation) and len(place):
        far, at = _largest(np.einsum("mi,mit->mt", relation.values, a.cofactors[relation.columns][:, :, onto]), place)
    return Reliability(Effects(_scaled(length, blunder), where), Effects(_scaled(far, by_relation), at))


def _largest(shifts: Floats, place: Integers) -> tuple[Floats, Integers]:
    """Length and place of the largest of shifts (..., 3 places), X, Y, Z of one place after the other."""
    lengths = np.linalg.norm(shifts.reshape(*shifts.shape[:-1], -1, 3), axis=-1)
    worst = np.argmax(lengths, axis=-1)
    return np.take_along_axis(lengths, worst[..., None], axis=-1)[..., 0], place[worst]


def _scaled(length: Floats, blunder: Floats) -> Floats:
    """The effect of each blunder; infinite where the blunder is, whatever it moves."""
    known = np.isfinite(blunder)
    scaled: Floats = np.where(known, length * np.where(known, blunder, 0.0), np.inf)
    return scaled
