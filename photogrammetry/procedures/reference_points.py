"""The reference points of a free block, with what an error in one of their images would do to the block."""

from collections.abc import Sequence

import numpy as np

from photogrammetry.adjustment.adjustment import Adjustment
from photogrammetry.adjustment.hypotheses import observation_row
from photogrammetry.adjustment.state import Floats
from photogrammetry.adjustment.unknowns import Integers
from photogrammetry.network import Point
from photogrammetry.procedures.reference_estimate import ImagePoint, ReferencePoint


def reference_points(free: Adjustment, surveyed: Sequence[Point]) -> tuple[list[ReferencePoint], Floats]:
    """The reference points in both systems and the covariance of their coordinates in the block.

    Args:
        free: the free adjustment, which has them as tie points.
        surveyed: n points with coordinates.

    Returns:
        n reference points, and the covariance (3 n, 3 n).
    """
    place = {point.name: i for i, point in enumerate(free.network.points)}
    indices = np.array([place[point.name] for point in surveyed], dtype=np.intp)
    columns = free.problem.unknowns.point[indices].reshape(-1)
    points = []
    for index, point in zip(indices, surveyed, strict=True):
        sigma = np.zeros(3) if point.sigma is None else point.sigma
        rows = np.flatnonzero(free.problem.point == index)
        images = tuple(_image_point(free, int(row), columns) for row in rows)
        points.append(ReferencePoint(free.state.xyz[index], np.asarray(point.xyz), sigma, images))
    return points, free.covariance(columns)


def _image_point(free: Adjustment, row: int, columns: Integers) -> ImagePoint:
    """An image point of the problem's order; errors in units of its standard deviations."""
    where, slopes = observation_row(free, np.array([2 * row, 2 * row + 1]))
    variance = free.ratio**2
    return ImagePoint(
        int(free.problem.order[row]),
        free.cofactors[np.ix_(columns, where)] @ slopes.T,
        free.controlled.image[row] / variance,
        -free.equations.v[row] / variance,
    )
