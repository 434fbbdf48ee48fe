"""The three stages of the search for gross errors in a surveyed network, and what each of them found.

1. Free adjustment of the images alone: shows gross errors of image coordinates, independently of the survey.
2. Similarity transformation of the free block onto the reference points: shows gross errors of the survey.
3. Adjustment with the reference coordinates as weighted observations (D3b): shows the remaining gross errors, with the
   strongest geometry.

An observation that a stage takes out stays out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from photogrammetry.adjustment.equations.unknowns import State, state_of
from photogrammetry.adjustment.gross_errors.blunders import (
    Blunder,
    BlunderKind,
    Removed,
    describe,
    observation_to_json,
)
from photogrammetry.adjustment.gross_errors.snooping import BENT
from photogrammetry.adjustment.run import Outcome, adjust
from photogrammetry.adjustment.solution.adjustment import adjust_once
from photogrammetry.adjustment.solution.global_test import GlobalTest
from photogrammetry.adjustment.solution.usability import is_unusable
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError, RefusedError
from photogrammetry.network.model import Network
from photogrammetry.procedures.doubtful_poses import refuse_contradicted, refuse_exchanged_cameras
from photogrammetry.procedures.findings import STAGE_RISK, SURVEYED, Finding, Stage, StageName, told_of, too_many
from photogrammetry.procedures.free_block import (
    OF_POINTS,
    adjusted_words,
    carried,
    findings_of,
    free_stage,
    state_in,
    without_removed,
    without_suspects,
)
from photogrammetry.procedures.minima import Minimum, adjust_least, is_worse, least_minimum
from photogrammetry.procedures.reference.consensus import FEWEST_AGREEING
from photogrammetry.procedures.reference.similarity_stage import similarity_stage
from photogrammetry.procedures.single_rays import contradicted_rays
from photogrammetry.start_values.search import complete
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """What the first two stages leave to the third.

    Attributes:
        network: without the observations that were taken out.
        start: start values from the free block; None if it could not be carried into the object system.
        removed: what was taken out.
        stages: the first two.
    """

    network: Network
    start: State | None
    removed: tuple[Removed, ...]
    stages: tuple[Stage, ...]


def search_block(network: Network) -> Search:
    """Search for gross errors of the images alone, then of the survey against them.

    Args:
        network: images, reference points and tie points.

    Raises:
        RefusedError: images and survey contradict each other, and not because of a few points.
    """
    free, gone, stage = free_stage(network)
    cleaned = without_removed(network, gone)
    refuse_exchanged_cameras(cleaned, np.inf if free is None else free.adjustment.ratio)
    if free is None:
        nothing = Stage(StageName.SIMILARITY, "left out: there is no free block")
        return Search(cleaned, None, (), (stage, nothing))
    block = without_suspects(free)
    try:
        fit, wrong, second = similarity_stage(cleaned, block)
    except RefusedError as error:
        start = _start_by_survey(cleaned, None)
        if start is None:
            search = by_survey_alone(network)
            if not _holds(search):
                raise
            return search
        return _without_block(network, Search(cleaned, start, tuple(gone), (stage, _other_block(str(error)))))
    start = None if fit is None else carried(cleaned, block, free, fit.estimate.transform)
    if start is not None and second.findings and (other := _start_by_survey(cleaned, start)) is not None:
        words = "; ".join(finding.message for finding in second.findings)
        return _without_block(network, Search(cleaned, other, tuple(gone), (stage, _other_block(words))))
    removed = (*gone, *wrong)
    left = without_removed(network, removed)
    start = None if fit is None else carried(left, block, free, fit.estimate.transform)
    return Search(left, start, removed, (stage, second))


def by_survey_alone(network: Network) -> Search:
    """What is left to the third stage where the survey alone leads to start values: everything."""
    return Search(network, None, (), ())


def _start_by_survey(network: Network, by_block: State | None) -> State | None:
    """Where survey and images agree although the free block contradicts the survey; None: they do not.

    Images of a plane form two blocks that fit them alike, and only one of them fits the survey.

    Args:
        network: with all of its survey.
        by_block: the start that the free block leads to, which must lead to a worse minimum; None if there is none.
    """
    try:
        found = least_minimum(adjust_once(network, state_of(complete(network))), network)
    except (BadInputError, NotSolvableError, NotConvergedError):
        return None
    if found.ratio > BENT:
        return None
    if by_block is not None:
        try:
            other = adjust_once(network, by_block)
        except (NotSolvableError, NotConvergedError):
            return found.state
        if not is_worse(Minimum.of(other), Minimum.of(found), found.redundancy):
            return None
    return found.state


def _holds(search: Search) -> bool:
    """Whether the third stage comes to a result that fits."""
    try:
        return constrained_stage(search)[0].adjustment.ratio <= BENT
    except (BadInputError, NotSolvableError, NotConvergedError, RefusedError):
        return False


def _other_block(words: str) -> Stage:
    return Stage(
        StageName.SIMILARITY,
        f"left out: the images alone form a block other than that of the survey, with which they agree ({words})",
    )


def _without_block(network: Network, search: Search) -> Search:
    """What is left to the third stage where the free block is not that of the survey.

    Observations that do not fit the other block may fit the survey: they take part again, if all then agree.

    Args:
        network: with all of its observations.
        search: what is left without those that the free adjustment took out.
    """
    if not search.removed:
        return search
    start = _start_by_survey(network, None)
    if start is None:
        return search
    free, similarity = search.stages
    again = replace(free, words=f"{free.words}; what did not fit this block takes part again", findings=())
    return Search(network, start, (), (again, similarity))


def constrained_stage(search: Search) -> tuple[Outcome, Stage]:
    """Adjust with what the first two stages left; the outcome names all that the three stages took out.

    Raises:
        RefusedError: the outcome is absurd.
        NotSolvableError, NotConvergedError: of the adjustment.
    """
    network, start, aside = search.network, search.start, list[Removed]()
    if start is not None:
        aside = contradicted_rays(network, start)
        cleaned = without_removed(network, aside)
        network, start = cleaned, state_in(cleaned, network, start)
    start = state_of(complete(network)) if start is None else start
    try:
        outcome = adjust_least(network, start, search.network, snoop=True, family_risk=STAGE_RISK)
    except (NotSolvableError, NotConvergedError):
        if search.start is None:
            raise
        other = state_of(complete(network))  # the block may have led astray
        outcome = adjust_least(network, other, search.network, snoop=True, family_risk=STAGE_RISK)
    outcome, more = _without_doubtful_points(outcome)
    aside += more
    findings = (*(Finding(_aside(one), removed=False) for one in aside), *findings_of(outcome))
    stage = Stage(StageName.CONSTRAINED, adjusted_words(outcome), findings)
    outcome = replace(outcome, removed=(*search.removed, *outcome.removed), aside=tuple(aside))
    refuse_absurd(outcome, [finding.said for part in (*search.stages, stage) for finding in part.findings])
    return outcome, stage


def _without_doubtful_points(outcome: Outcome) -> tuple[Outcome, list[Removed]]:
    """Leave out observations of a point of which one is wrong, nobody knows which; so the result is free of its error.

    Groups of several points stay: they may be all that holds the network.
    """
    aside: list[Removed] = []
    while doubtful := [b for b in outcome.blunders if len(_points_of(outcome.adjustment.network, b)) == 1]:
        network, state = outcome.adjustment.network, outcome.adjustment.state
        gone = Removed(doubtful[0], network)
        cleaned = without_removed(network, [gone])
        try:
            again = adjust(cleaned, state_in(cleaned, network, state), snoop=True, family_risk=STAGE_RISK)
        except (BadInputError, NotSolvableError, NotConvergedError):
            break  # the network needs them
        outcome = replace(again, removed=(*outcome.removed, *again.removed))
        aside.append(gone)
    return outcome, aside


def _points_of(network: Network, blunder: Blunder) -> set[str]:
    """The points of a group that cannot be told apart; none if it is not such a group, or not of points alone."""
    if len(blunder.candidates) < 2 or any(one.kind not in OF_POINTS for one in blunder.candidates):
        return set()
    return {observation_to_json(network, one)["point"] for one in blunder.candidates}


def _aside(gone: Removed) -> Phrase:
    what = describe(gone.network, gone.blunder)
    return phrase("blunder_aside", "{what}; the result does not use them", what=what)


def snoop_network(network: Network) -> Outcome:
    """Adjust a network, and take out the gross errors that can be located.

    Where the sigmas do not explain the residuals, images and survey are searched apart first, as on the hill: several
    wrong control points hide each other, and lead the start values astray.

    Args:
        network: any network.

    Raises:
        RefusedError: the data contradict each other so much that no result can be believed.
        NotSolvableError, NotConvergedError, BadInputError: as the adjustment.
    """
    start = state_of(complete(network))
    surveyed = sum(point.role in SURVEYED for point in network.points) >= FEWEST_AGREEING
    if surveyed and all(image.estimate for image in network.images):
        try:
            whole = adjust_once(network, start)
        except (NotConvergedError, NotSolvableError):
            whole = None  # wrong names lead the start values astray
        if whole is None or whole.ratio > BENT:
            outcome, _ = constrained_stage(search_block(network))
            refuse_contradicted(network, outcome.adjustment)
            return outcome
        start = whole.state
    outcome = adjust_least(network, start, network, snoop=True)
    refuse_absurd(outcome, [finding.said for finding in findings_of(outcome)])
    return outcome


def refuse_absurd(outcome: Outcome, findings: Sequence[Phrase]) -> None:
    """Refuse an outcome that the global test calls absurd, or that lost more than a third of its survey.

    Args:
        outcome: with what was taken out.
        findings: what is known to be wrong.

    Raises:
        RefusedError: says what to do.
    """
    a = outcome.adjustment
    if is_unusable(a):
        test = GlobalTest(a.ratio, a.redundancy)
        text = "sigma0 is {words}"
        absurd = phrase("refused_sigma0", text, words=test.words, ratio=f"{test.ratio:.3g}", high=test.limits[1])
        raise RefusedError(told_of(absurd, findings))
    gone = [
        g.network.points[g.blunder.suspect.index].name
        for g in outcome.removed
        if g.blunder.suspect.kind is BlunderKind.CONTROL
    ]
    left = sum(point.role in SURVEYED for point in a.network.points)
    if 3 * len(gone) > len(gone) + left:
        raise RefusedError(told_of(too_many(gone, len(gone) + left), findings))
