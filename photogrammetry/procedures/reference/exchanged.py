"""Finds out what is wrong with a survey that the images contradict: exchanged names, a mirrored system."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from photogrammetry.adjustment.gross_errors.suspicion import SINGLE_RISK
from photogrammetry.adjustment.solution.global_test import ABSURD
from photogrammetry.network.model import Point
from photogrammetry.procedures.reference.consensus import FEWEST_AGREEING
from photogrammetry.procedures.reference.reference_estimate import ReferencePoint
from photogrammetry.procedures.reference.reference_fit import ReferenceFit, fit_reference
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase

#: A point lies where another one was surveyed if the square of the difference over its covariance is below this.
_THERE = float(special.chdtri(3, SINGLE_RISK))
_MIRROR = np.array([1.0, 1.0, -1.0])


@dataclass(frozen=True, slots=True)
class Exchange:
    """Points whose names were exchanged.

    Attributes:
        points: each lies where the survey has the next one, the last one where it has the first.
        seen: whether the images show so of every one of them; else of the first alone.
    """

    points: tuple[str, ...]
    seen: bool = True

    @property
    def said(self) -> Phrase:
        """The finding in words."""
        if not self.seen:
            first, other = self.points
            text = "{first} lies where the survey has {other}: {first} and {other} look exchanged; correct the names"
            return phrase("exchanged_unseen", text, first=first, other=other)
        names, last = ", ".join(self.points[:-1]), self.points[-1]
        if len(self.points) == 2:
            text = "{names} and {last} look exchanged, each lies where the survey has the other; correct the names"
            return phrase("exchanged_two", text, names=names, last=last)
        text = "{names} and {last} look exchanged, each lies where the survey has the next; correct the names"
        return phrase("exchanged_more", text, names=names, last=last)


def find_exchanges(
    fit: ReferenceFit, reference: Sequence[ReferencePoint], covariance: Floats, survey: Mapping[str, Point]
) -> tuple[Exchange, ...]:
    """The exchanged names among the wrong reference points.

    Args:
        fit: the block on its reference points.
        reference: the n reference points of the block.
        covariance: (3 n, 3 n) of their coordinates in the block.
        survey: all surveyed points by name, those of the block first and in its order.
    """
    names = list(survey)
    wrong = [suspect.index for suspect in (*fit.removed, *fit.suspects)]
    unseen = range(len(reference), len(names))
    there = {
        i: k for i in wrong if (k := _place_of(i, fit, reference, covariance, survey, [*wrong, *unseen])) is not None
    }
    found, told = [], set()
    for i in wrong:
        chain = [i]
        while (following := there.get(chain[-1])) is not None and following not in chain:
            chain.append(following)
        if i in told or len(chain) < 2:
            continue
        if there.get(chain[-1]) == i:
            found.append(Exchange(tuple(names[k] for k in chain)))
        elif chain[-1] in unseen and len(chain) == 2:
            found.append(Exchange((names[i], names[chain[-1]]), seen=False))
        else:
            continue
        told.update(chain)
    return tuple(found)


def _place_of(
    i: int,
    fit: ReferenceFit,
    reference: Sequence[ReferencePoint],
    covariance: Floats,
    survey: Mapping[str, Point],
    others: Sequence[int],
) -> int | None:
    """Which of some other points was surveyed where the images show point i."""
    transform, own = fit.estimate.transform, covariance[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
    place = transform.apply(reference[i].block)
    spread = transform.scale**2 * transform.rotation @ own @ transform.rotation.T * max(1.0, fit.estimate.ratio**2)
    points = list(survey.values())
    best, least = None, _THERE
    for k in others:
        given = points[k]
        if k == i or given.xyz is None:
            continue
        sigma = np.zeros(3) if given.sigma is None else given.sigma
        off = place - given.xyz
        size = float(off @ np.linalg.solve(spread + np.diag(sigma**2), off))
        if size < least:
            best, least = k, size
    return best


def is_mirrored(reference: Sequence[ReferencePoint], covariance: Floats, family_risk: float) -> bool:
    """Whether the survey fits the block as soon as one of its axes is turned round."""
    turned = [replace(point, surveyed=point.surveyed * _MIRROR) for point in reference]
    try:
        fit = fit_reference(turned, covariance, family_risk)
    except BadInputError:
        return False
    # three points always fit both ways
    return fit.count >= FEWEST_AGREEING and not fit.too_many and fit.estimate.ratio <= ABSURD
