"""Carries a free block onto the surveyed reference points and takes wrong reference points out (step 2, stage 2)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from photogrammetry.adjustment.gross_errors.hypotheses import observation_row
from photogrammetry.adjustment.gross_errors.suspicion import FAMILY_RISK, SINGLE_RISK
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.geometry.similarity import fit_similarity
from photogrammetry.network.model import Point
from photogrammetry.procedures.reference.consensus import agreeing_points
from photogrammetry.procedures.reference.reference_estimate import (
    ImagePoint,
    ReferenceEstimate,
    ReferencePoint,
    Suspect,
)
from rig.arrays import Floats, Integers
from rig.errors import BadInputError

_POINTS_LEAST: Final = 3  # points of a similarity transformation


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceFit:
    """The transformation of a free block onto its reference points.

    Attributes:
        estimate: the final estimation, from the points that are left.
        removed: wrong points that were taken out, in that order.
        suspects: further points that do not agree, but cannot be located.
        count: number of all reference points.
    """

    estimate: ReferenceEstimate
    removed: tuple[Suspect, ...]
    suspects: tuple[Suspect, ...]
    count: int

    @property
    def too_many(self) -> bool:
        """Whether so many points were taken out that the cause is not single points."""
        return len(self.removed) > self.count // 3


def fit_reference(
    points: Sequence[ReferencePoint], covariance: Floats, family_risk: float = FAMILY_RISK
) -> ReferenceFit:
    """Carry a free block onto its reference points and take out wrong ones.

    Args:
        points: n reference points.
        covariance: (3 n, 3 n) of their coordinates in the block.
        family_risk: probability that anything is suspected in sound data.

    Raises:
        BadInputError: fewer than three points, all on a line, or numbers beyond all bounds.
    """
    if len(points) < _POINTS_LEAST:
        raise BadInputError(f"{len(points)} reference points that two images show: give at least three")
    try:
        with np.errstate(all="ignore"):
            return _fitted(points, covariance, family_risk)
    except np.linalg.LinAlgError:
        raise BadInputError("the numbers leave all bounds; check units and sigmas") from None


def _fitted(points: Sequence[ReferencePoint], covariance: Floats, family_risk: float) -> ReferenceFit:
    used, removed, unsure = _agreeing(points, covariance, family_risk)
    while True:
        estimate = ReferenceEstimate.of(points, covariance, used)
        suspect = estimate.suspect(family_risk)
        if suspect is None:
            break
        remaining = [i for i in used if i != suspect.index]
        enough = len(used) > _POINTS_LEAST and len(removed) <= len(points) // 3
        if not (suspect.certain and enough and _spans(points, remaining)):
            unsure.append(suspect)
            break
        removed.append(suspect)
        used = remaining
    # The final transformation, free of their errors, gives better estimates than the one they took part in.
    wrong = [points[suspect.index] for suspect in removed]
    errors = [point.surveyed - estimate.transform.apply(point.block) for point in wrong]
    gone = tuple(replace(suspect, estimate=error) for suspect, error in zip(removed, errors, strict=True))
    return ReferenceFit(estimate, gone, tuple(unsure), len(points))


def _agreeing(
    points: Sequence[ReferencePoint], covariance: Floats, family_risk: float
) -> tuple[list[int], list[Suspect], list[Suspect]]:
    """The points to begin with, those that are certainly wrong, and those that may be.

    If chance explains the misclosures of all points together, all are used. Otherwise each point that does not agree
    with the majority is tested beside the majority alone, where no other error can hide it or pass for it.
    """
    everyone = list(range(len(points)))
    if _chance(points, covariance) >= SINGLE_RISK:
        return everyone, [], []
    used = agreeing_points(points, covariance, min(SINGLE_RISK, family_risk / len(points)))
    majority = ReferenceEstimate.of(points, covariance, used)
    sound, removed, unsure = list(used), list[Suspect](), list[Suspect]()
    for i in (i for i in everyone if i not in used):
        suspect = ReferenceEstimate.of(points, covariance, sorted([*used, i]), majority.transform).suspect(family_risk)
        if suspect is None:
            sound.append(i)
        else:
            (removed if suspect.certain and suspect.index == i else unsure).append(suspect)
    removed.sort(key=lambda suspect: -suspect.w)
    return sorted(sound), removed, unsure


def _chance(points: Sequence[ReferencePoint], covariance: Floats) -> float:
    """Probability of such misclosures in sound points; 0 if a few points in another unit spoil the estimation."""
    try:
        return ReferenceEstimate.of(points, covariance, range(len(points))).chance
    except np.linalg.LinAlgError:
        return 0.0


def _spans(points: Sequence[ReferencePoint], chosen: Sequence[int]) -> bool:
    """Whether some of the points determine a transformation."""
    try:
        fit_similarity([points[i].block for i in chosen], [points[i].surveyed for i in chosen])
    except BadInputError:
        return False
    return True


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
    """The image point of a row of the problem; errors in units of its standard deviations."""
    where, slopes = observation_row(free, np.array([2 * row, 2 * row + 1]))
    variance = free.ratio**2
    return ImagePoint(
        int(free.problem.order[row]),
        free.cofactors[np.ix_(columns, where)] @ slopes.T,
        free.controlled.image[row] / variance,
        -free.equations.v[row] / variance,
    )
