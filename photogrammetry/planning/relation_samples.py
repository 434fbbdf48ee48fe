"""Normal equations of many samples at a time, and what observations other than image points add to them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from photogrammetry.adjustment.problem import Problem
from photogrammetry.adjustment.relations import Kind
from photogrammetry.adjustment.unknowns import Integers

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Normals:
    """Whitened normal equations of n samples; the last kept column takes what is constant.

    Attributes:
        kept: (n, k + 1, k + 1) cameras, poses and points that are not eliminated.
        gradient: (n, k + 1).
        own: (n, p, 3, 3) of each eliminated point.
        own_gradient: (n, p, 3).
        mixed: (n, p, 3, k + 1).
    """

    kept: Floats
    gradient: Floats
    own: Floats
    own_gradient: Floats
    mixed: Floats

    @classmethod
    def zeros(cls, samples: int, kept: int, eliminated: int) -> "Normals":
        """Nothing observed yet."""
        wide = kept + 1
        return cls(
            np.zeros((samples, wide, wide)),
            np.zeros((samples, wide)),
            np.zeros((samples, eliminated, 3, 3)),
            np.zeros((samples, eliminated, 3)),
            np.zeros((samples, eliminated, 3, wide)),
        )

    def add(self, columns: Integers, slopes: Floats, v: Floats) -> None:
        """Rows of kept unknowns alone: slopes (n, rows, c) by `columns` (c,), each once; residuals (n, rows)."""
        transposed = slopes.swapaxes(1, 2)
        self.kept[:, columns[:, None], columns] += transposed @ slopes
        self.gradient[:, columns] += (transposed @ v[..., None])[..., 0]

    def add_cross(self, one: Integers, other: Integers, by_one: Floats, by_other: Floats) -> None:
        """What rows mix of two groups of kept unknowns; slopes (n, rows, columns)."""
        product = by_one.swapaxes(1, 2) @ by_other
        self.kept[:, one[:, None], other] += product
        self.kept[:, other[:, None], one] += product.swapaxes(1, 2)

    def add_own(self, place: Integers, columns: Integers, by_own: Floats, by_kept: Floats, v: Floats) -> None:
        """Pairs of rows of eliminated points, each point once: slopes (n, m, 2, 3) and (n, m, 2, c)."""
        self.own[:, place] += _products(by_own, by_own)
        self.own_gradient[:, place] += by_own[:, :, 0] * v[:, :, :1] + by_own[:, :, 1] * v[:, :, 1:]
        self.mixed[:, place[:, None, None], np.arange(3)[:, None], columns] += _products(by_own, by_kept)


def _products(one: Floats, other: Floats) -> Floats:
    """Transposed `one` times `other`, both (n, m, 2, .); quicker than so many small matrix products."""
    products: Floats = one[:, :, 0, :, None] * other[:, :, 0, None] + one[:, :, 1, :, None] * other[:, :, 1, None]
    return products


def add_relations(normals: Normals, problem: Problem, truth: Floats, xyz: Floats, errors: Floats) -> None:
    """Control points, distances and differences (a plan has no other relations).

    Args:
        normals: to add to.
        problem: the planned network.
        truth: (points, 3).
        xyz: (n, points, 3) of the samples.
        errors: (n, m) of the observed values, whitened.
    """
    network, relations, unknowns = problem.network, problem.relations, problem.unknowns
    for row, (kind, i, axis) in enumerate(zip(relations.kind, relations.item, relations.part, strict=True)):
        weight, error = 1.0 / problem.relation_sigma[row], errors[:, row]
        if kind == Kind.CONTROL:
            v, column = weight * (xyz[:, i, axis] - truth[i, axis]) - error, unknowns.point[i, axis]
            if column < unknowns.n_kept_end:
                normals.kept[:, column, column] += weight**2
                normals.gradient[:, column] += weight * v
            else:
                place = (column - unknowns.n_kept_end) // 3
                normals.own[:, place, axis, axis] += weight**2
                normals.own_gradient[:, place, axis] += weight * v
            continue
        if kind == Kind.DIFFERENCE:
            e = network.differences[i]
            start, end, value = e.start, e.end, e.value
            direction = np.broadcast_to(np.eye(3)[axis], (len(xyz), 3))
            length = xyz[:, end, axis] - xyz[:, start, axis]
        else:
            d = network.distances[i]
            start, end, value = d.start, d.end, d.value
            direction = xyz[:, end] - xyz[:, start]
            length = np.linalg.norm(direction, axis=1)
            direction = direction / length[:, None]
        slopes = weight * np.concatenate([-direction, direction], axis=1)[:, None]
        columns = np.append(unknowns.point[start], unknowns.point[end])
        normals.add(columns, slopes, (weight * (length - value) - error)[:, None])
