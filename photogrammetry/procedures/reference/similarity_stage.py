"""The second stage: carries the free block onto the surveyed points and finds what is wrong with the survey."""

from collections.abc import Mapping, Sequence

import numpy as np

from photogrammetry.adjustment.gross_errors.blunders import (
    Blunder,
    BlunderKind,
    Observation,
    Removed,
    describe,
)
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.global_test import ABSURD, TOLERABLE
from photogrammetry.network.diagnosis import RefusedError
from photogrammetry.network.model import Network, Point
from photogrammetry.network.selection import (
    observation_names,
)
from photogrammetry.procedures.findings import (
    STAGE_RISK,
    SURVEYED,
    Finding,
    PointTest,
    Stage,
    StageName,
    told_of,
    too_many,
)
from photogrammetry.procedures.reference.consensus import FEWEST_AGREEING
from photogrammetry.procedures.reference.exchanged import Exchange, find_exchanges, is_mirrored
from photogrammetry.procedures.reference.reference_estimate import ReferencePoint, Suspect
from photogrammetry.procedures.reference.reference_fit import ReferenceFit, fit_reference, reference_points
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase
from rig.phrases import in_turn


def similarity_stage(network: Network, free: Outcome) -> tuple[ReferenceFit | None, list[Removed], Stage]:
    """Carry the free block onto the reference points; None if there are too few of them."""
    a = free.adjustment
    place = {point.name: i for i, point in enumerate(a.network.points)}
    given = [i for i, p in enumerate(network.points) if p.role in SURVEYED and p.xyz is not None]
    surveyed = [i for i in given if network.points[i].name in place]
    reference, covariance = reference_points(a, [network.points[i] for i in surveyed])
    try:
        fit = fit_reference(reference, covariance, STAGE_RISK)
    except BadInputError as error:
        _refuse_mirrored(reference, covariance)
        return None, [], Stage(StageName.SIMILARITY, f"left out: {error}")
    order = [*surveyed, *(i for i in given if i not in surveyed)]
    survey = {network.points[i].name: network.points[i] for i in order}
    exchanges = find_exchanges(fit, reference, covariance, survey)
    wrong = [Removed(_blunder(suspect, surveyed, network, a), network) for suspect in fit.removed]
    told = [
        in_turn([describe(network, gone.blunder), _tests_of(s)]) for gone, s in zip(wrong, fit.removed, strict=True)
    ]
    for exchange in exchanges:
        if not exchange.seen:
            unseen = _unseen(network, exchange, wrong)
            wrong.append(unseen)
            told.append(describe(network, unseen.blunder))
    findings = [Finding(said, removed=True) for said in told]
    for suspect in fit.suspects:
        blunder = _blunder(suspect, surveyed, network, a)
        findings.append(Finding(in_turn([describe(network, blunder), _tests_of(suspect)]), removed=False))
    _refuse_fit(fit, exchanges, reference, covariance, list(survey))
    findings += [Finding(exchange.said, removed=False) for exchange in exchanges]
    return fit, wrong, Stage(StageName.SIMILARITY, _fit_words(fit, network), tuple(findings), _tests(fit, survey))


def _refuse_fit(
    fit: ReferenceFit,
    exchanges: Sequence[Exchange],
    reference: Sequence[ReferencePoint],
    covariance: Floats,
    names: Sequence[str],
) -> None:
    """Refuse a survey that contradicts the images.

    Raises:
        RefusedError: says what is wrong as far as it is known.
    """
    # of fewer points none is a majority: which of them is wrong is asked, not whether
    absurd = not fit.estimate.ratio <= ABSURD and fit.count > FEWEST_AGREEING and _is_gross(fit, reference)
    if not (absurd or fit.too_many):
        return
    _refuse_mirrored(reference, covariance)
    known = [exchange.said for exchange in exchanges]
    if fit.too_many:
        gone = [names[suspect.index] for suspect in fit.removed]
        raise RefusedError(told_of(too_many(gone, len(reference)), known))
    text = (
        "the survey contradicts the images: carried onto the {count} reference points, the free block has sigma0 "
        "{ratio} (a priori 1); check names, units and sigmas of the survey, the interior orientations, and whether two "
        "cameras are exchanged"
    )
    absurd_fit = phrase("refused_survey", text, count=len(reference), ratio=f"{fit.estimate.ratio:.3g}")
    raise RefusedError(told_of(absurd_fit, known))


def _refuse_mirrored(reference: Sequence[ReferencePoint], covariance: Floats) -> None:
    if is_mirrored(reference, covariance, STAGE_RISK):
        text = (
            "the survey is mirrored: it fits the images once an axis is turned round; X, Y, Z must be right-handed, so "
            "exchange two axes or the sign of one"
        )
        raise RefusedError(phrase("refused_mirrored", text))


def _is_gross(fit: ReferenceFit, reference: Sequence[ReferencePoint]) -> bool:
    """Whether the residuals (rms of the coordinates) exceed what a result may have."""
    extent = float(np.ptp([point.surveyed for point in reference], axis=0).max())
    return not np.sqrt(np.mean(fit.estimate.v**2)) <= TOLERABLE * extent


def _unseen(network: Network, exchange: Exchange, wrong: Sequence[Removed]) -> Removed:
    """The wrong survey of a point that too few images show, as the exchange with another one tells."""
    place = {point.name: i for i, point in enumerate(network.points)}
    first, other = (place[name] for name in exchange.points)
    w = next((gone.blunder.w for gone in wrong if gone.blunder.suspect.index == first), 0.0)
    off = np.asarray(network.points[other].xyz, float) - np.asarray(network.points[first].xyz, float)
    return Removed(Blunder(Observation(BlunderKind.CONTROL, other), off, w, True, ()), network)


def _fit_words(fit: ReferenceFit, network: Network) -> str:
    estimate = fit.estimate
    v = estimate.v.reshape(-1, 3)
    return (
        f"{len(estimate.used)} reference points, redundancy {estimate.redundancy}, residuals rms X Y Z "
        + " ".join(f"{value:.3g}" for value in np.sqrt(np.mean(v**2, axis=0)))
        + f" {network.length_unit}, sigma0 {estimate.ratio:.3g} (a priori 1)"
    )


def _tests(fit: ReferenceFit, survey: Mapping[str, Point]) -> tuple[PointTest, ...]:
    estimate, names = fit.estimate, list(survey)
    figures = (estimate.v.reshape(-1, 3).tolist(), estimate.controlled.tolist(), estimate.w.tolist())
    return tuple(
        PointTest(names[i], *(tuple(values) for values in rows))
        for i, *rows in zip(estimate.used, *figures, strict=True)
    )


def _tests_of(suspect: Suspect) -> Phrase:
    """The tests of a reference point's coordinates in words."""
    w, r = (" ".join(f"{value:.2f}" for value in values) for values in (suspect.single, suspect.controlled))
    return phrase("blunder_tests", "w of X, Y, Z {w}, redundancy numbers {r}", w=w, r=r)


def _blunder(suspect: Suspect, surveyed: Sequence[int], network: Network, free: Adjustment) -> Blunder:
    """A wrong reference point in the form of the adjustment's blunders."""
    rows = {names: i for i, names in enumerate(observation_names(network))}
    names = observation_names(free.network)
    itself = Observation(BlunderKind.CONTROL, surveyed[suspect.index])
    others = [Observation(BlunderKind.CONTROL, surveyed[i]) for i in suspect.candidates if i != suspect.index]
    others += [Observation(BlunderKind.IMAGE, rows[names[i]]) for i in suspect.images]
    candidates = () if suspect.certain else (itself, *others)
    return Blunder(itself, suspect.estimate, suspect.w, suspect.certain, candidates)
