"""The second stage of the search for gross errors: a free block carried onto the surveyed reference points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from photogrammetry.adjustment.state import Floats
from photogrammetry.adjustment.suspicion import FAMILY_RISK
from photogrammetry.procedures.reference_estimate import ReferenceEstimate, ReferencePoint, Suspect
from photogrammetry.similarity import Similarity, fit_similarity
from rig.errors import BadInputError

_FEWEST: Final = 3  # points of a similarity transformation


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceFit:
    """The transformation with its residuals.

    Attributes:
        transform: block to object system.
        used: indices of the points that it was estimated from.
        residuals: (n, 3) transformed - surveyed, of all points.
        ratio: estimated / a-priori sigma0.
        redundancy: 3 used - 7.
        w: (used, 3) test values of the coordinates; NaN where nothing controls one.
        controlled: (used, 3) their redundancy numbers, which add up to the redundancy.
        removed: wrong points that were taken out, in that order.
        suspect: one that is left: the data cannot tell which it is, or too many went before it.
    """

    transform: Similarity
    used: tuple[int, ...]
    residuals: Floats
    ratio: float
    redundancy: int
    w: Floats
    controlled: Floats
    removed: tuple[Suspect, ...] = ()
    suspect: Suspect | None = None


def fit_reference(
    points: Sequence[ReferencePoint], covariance: Floats, family_risk: float = FAMILY_RISK
) -> ReferenceFit:
    """Carry a free block onto its reference points and take wrong ones out, the worst first.

    Args:
        points: n reference points.
        covariance: (3 n, 3 n) of their coordinates in the block.
        family_risk: chance that anything at all is suspected in sound data.

    Raises:
        BadInputError: fewer than three points, all on a line, or numbers beyond all bounds.
    """
    if len(points) < _FEWEST:
        raise BadInputError(f"{len(points)} reference points that two images show: give at least three")
    try:
        with np.errstate(all="ignore"):
            return _fitted(points, covariance, family_risk)
    except np.linalg.LinAlgError:
        raise BadInputError("the numbers leave all bounds; check units and sigmas") from None


def _fitted(points: Sequence[ReferencePoint], covariance: Floats, family_risk: float) -> ReferenceFit:
    used = list(range(len(points)))
    removed: list[Suspect] = []
    most = len(points) // 3  # with more something else is wrong
    while True:
        estimate = ReferenceEstimate.of(points, covariance, used)
        suspect = estimate.suspect(family_risk)
        if suspect is None or not suspect.certain or len(removed) == most or len(used) <= _FEWEST:
            break
        remaining = [i for i in used if i != suspect.index]
        try:
            fit_similarity([points[i].block for i in remaining], [points[i].surveyed for i in remaining])
        except BadInputError:
            break
        removed.append(suspect)
        used = remaining
    residuals = estimate.transform.apply([p.block for p in points]) - [p.surveyed for p in points]
    # Without them the estimate of their errors is exact; before, they pulled at the transformation.
    gone = tuple(replace(suspect, estimate=-residuals[suspect.index]) for suspect in removed)
    return ReferenceFit(
        estimate.transform,
        tuple(used),
        residuals,
        estimate.ratio,
        estimate.redundancy,
        estimate.w,
        estimate.controlled,
        gone,
        suspect,
    )
