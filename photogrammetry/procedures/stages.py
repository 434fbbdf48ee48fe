"""The three stages of the search for gross errors in a surveyed network, and what each of them found.

1. Free adjustment of the images alone: shows gross errors of image coordinates, independently of the survey.
2. Similarity transformation of the free block onto the reference points: shows gross errors of the survey.
3. Adjustment with the reference coordinates as weighted observations (D3b): shows the remaining gross errors, with the
   strongest geometry.

An observation that a stage takes out stays out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

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
from photogrammetry.adjustment.solution.global_test import ABSURD, GlobalTest
from photogrammetry.adjustment.solution.usability import is_unusable
from photogrammetry.geometry.similarity import Similarity, fit_similarity
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError, RefusedError
from photogrammetry.network.model import Network, Role
from photogrammetry.network.selection import (
    RAYS,
    as_check_points,
    only_points,
    rays,
    without_observations,
    without_survey,
)
from photogrammetry.procedures.consensus import FEWEST_AGREEING
from photogrammetry.procedures.doubtful_poses import refuse_contradicted, refuse_exchanged_cameras
from photogrammetry.procedures.findings import STAGE_RISK, SURVEYED, Finding, Stage, StageName, told_of, too_many
from photogrammetry.procedures.similarity_stage import similarity_stage
from photogrammetry.procedures.single_rays import contradicted_rays
from photogrammetry.start_values.search import complete
from rig.arrays import Floats
from rig.errors import BadInputError

_OF_POINTS: Final = (BlunderKind.IMAGE, BlunderKind.CONTROL)


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
    free, gone, stage = _free_stage(network)
    cleaned = _cleaned(network, gone)
    refuse_exchanged_cameras(without_survey(cleaned), np.inf if free is None else free.adjustment.ratio)
    if free is None:
        nothing = Stage(StageName.SIMILARITY, "left out: there is no free block")
        return Search(cleaned, None, (), (stage, nothing))
    block = _without_suspects(free)
    fit, wrong, second = similarity_stage(cleaned, block)
    removed = (*gone, *wrong)
    cleaned = _cleaned(network, removed)
    start = None if fit is None else _carried(cleaned, block, free, fit.estimate.transform)
    return Search(cleaned, start, removed, (stage, second))


def constrained_stage(search: Search) -> tuple[Outcome, Stage]:
    """Adjust with what the first two stages left; the outcome names all that the three stages took out.

    Raises:
        RefusedError: the outcome is absurd.
        NotSolvableError, NotConvergedError: of the adjustment.
    """
    network, start, aside = search.network, search.start, list[Removed]()
    if start is not None:
        aside = contradicted_rays(network, start)
        cleaned = _cleaned(network, aside)
        network, start = cleaned, _state_in(cleaned, network, start)
    start = state_of(complete(network)) if start is None else start
    outcome = adjust(network, start, snoop=True, family_risk=STAGE_RISK)
    outcome, more = _without_doubtful_points(outcome)
    aside += more
    findings = (*(Finding(_aside_words(one), removed=False) for one in aside), *_findings(outcome))
    stage = Stage(StageName.CONSTRAINED, _adjusted_words(outcome), findings)
    outcome = replace(outcome, removed=(*search.removed, *outcome.removed), aside=tuple(aside))
    refuse_absurd(outcome, [finding.message for part in (*search.stages, stage) for finding in part.findings])
    return outcome, stage


def _without_doubtful_points(outcome: Outcome) -> tuple[Outcome, list[Removed]]:
    """Leave out observations of a point of which one is wrong, nobody knows which; so the result is free of its error.

    Groups of several points stay: they may be all that holds the network.
    """
    aside: list[Removed] = []
    while doubtful := [b for b in outcome.blunders if len(_points_of(outcome.adjustment.network, b)) == 1]:
        network, state = outcome.adjustment.network, outcome.adjustment.state
        gone = Removed(doubtful[0], network)
        cleaned = _cleaned(network, [gone])
        try:
            again = adjust(cleaned, _state_in(cleaned, network, state), snoop=True, family_risk=STAGE_RISK)
        except (BadInputError, NotSolvableError, NotConvergedError):
            break  # the network needs them
        outcome = replace(again, removed=(*outcome.removed, *again.removed))
        aside.append(gone)
    return outcome, aside


def _points_of(network: Network, blunder: Blunder) -> set[str]:
    """The points of a group that cannot be told apart; none if it is not such a group, or not of points alone."""
    if len(blunder.candidates) < 2 or any(one.kind not in _OF_POINTS for one in blunder.candidates):
        return set()
    return {observation_to_json(network, one)["point"] for one in blunder.candidates}


def _aside_words(gone: Removed) -> str:
    return f"{describe(gone.network, gone.blunder)}; the result does not use them"


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
    outcome = adjust(network, start, snoop=True)
    refuse_absurd(outcome, [finding.message for finding in _findings(outcome)])
    return outcome


def refuse_absurd(outcome: Outcome, findings: Sequence[str]) -> None:
    """Refuse an outcome that the global test calls absurd, or that lost more than a third of its survey.

    Args:
        outcome: with what was taken out.
        findings: what is known to be wrong.

    Raises:
        RefusedError: says what to do.
    """
    a = outcome.adjustment
    if is_unusable(a):
        raise RefusedError(f"sigma0 is {GlobalTest(a.ratio, a.redundancy).words}{told_of(findings)}")
    gone = [
        g.network.points[g.blunder.suspect.index].name
        for g in outcome.removed
        if g.blunder.suspect.kind is BlunderKind.CONTROL
    ]
    left = sum(point.role in SURVEYED for point in a.network.points)
    if 3 * len(gone) > len(gone) + left:
        raise RefusedError(too_many(gone, len(gone) + left) + told_of(findings))


def _free_stage(network: Network) -> tuple[Outcome | None, list[Removed], Stage]:
    """Adjust the images alone; None if they do not determine a block."""
    try:
        outcome = _alone(without_survey(network))
    except (BadInputError, NotSolvableError, NotConvergedError) as error:
        return None, [], Stage(StageName.FREE, f"left out: the images alone do not form a block ({error})")
    return outcome, list(outcome.removed), Stage(StageName.FREE, _adjusted_words(outcome), _findings(outcome))


def _alone(network: Network) -> Outcome:
    """Adjust a free network; where given poses lead to nothing that can be believed, without them."""
    given = all(image.position is not None for image in network.images)
    try:
        outcome = adjust(network, state_of(complete(network)), snoop=True, family_risk=STAGE_RISK)
        if not given or outcome.adjustment.ratio <= ABSURD:
            return outcome
    except (NotConvergedError, NotSolvableError):
        if not given:
            raise
    forgotten = replace(network, images=tuple(replace(i, position=None, rotation=None) for i in network.images))
    return adjust(forgotten, state_of(complete(forgotten)), snoop=True, family_risk=STAGE_RISK)


def _without_suspects(free: Outcome) -> Outcome:
    """The free block without the undecided candidates, which might deform it; unchanged if it needs them."""
    if not free.blunders:
        return free
    network = free.adjustment.network
    suspects = {candidate for blunder in free.blunders for candidate in (blunder.suspect, *blunder.candidates)}
    named = [observation_to_json(network, suspect) for suspect in suspects]
    less = without_survey(without_observations(network, {(names["image"], names["point"]) for names in named}))
    try:
        return adjust(less, state_of(complete(less)), family_risk=STAGE_RISK)
    except (BadInputError, NotSolvableError, NotConvergedError):
        return free


def _cleaned(network: Network, removed: Sequence[Removed]) -> Network:
    """The network without the removed observations, matched by name because indices differ from stage to stage."""
    named = [
        observation_to_json(gone.network, one)
        for gone in removed
        for one in gone.blunder.candidates or (gone.blunder.suspect,)
    ]
    rows = {(n["image"], n["point"]) for n in named if n["kind"] == BlunderKind.IMAGE}
    points = {n["point"] for n in named if n["kind"] == BlunderKind.CONTROL}
    left = as_check_points(without_observations(network, rows), points)
    # nothing determines a point that one image shows, without its survey
    touched = {n["point"] for n in named if n["kind"] in _OF_POINTS}
    lonely = np.array(
        [
            p.name in touched and p.role not in SURVEYED and n < RAYS
            for p, n in zip(left.points, rays(left), strict=True)
        ],
        dtype=bool,
    )
    return only_points(left, ~lonely) if lonely.any() else left


def _carried(network: Network, block: Outcome, free: Outcome, transform: Similarity) -> State | None:
    """Start values from the block; None if a tie point is in neither it nor the free adjustment with all points."""
    state, places = block.adjustment.state, _places(block)
    whole = _places(free)
    if any(point.name in whole and point.name not in places for point in network.points):
        common = list(places)
        onto = fit_similarity([whole[name] for name in common], [places[name] for name in common])
        places = {name: onto.apply(xyz) for name, xyz in whole.items()} | places
    xyz = [transform.apply(places[p.name]) if p.name in places else p.xyz for p in network.points]
    if any(known is None for known in xyz):
        return None
    fixed = [p.xyz if p.role is Role.FIXED else known for p, known in zip(network.points, xyz, strict=True)]
    turned = transform.turn(state.rotation)
    return State(state.interior, transform.apply(state.position), turned, np.array(fixed, dtype=float))


def _places(outcome: Outcome) -> dict[str, Floats]:
    """Coordinates of the points by name."""
    a = outcome.adjustment
    return {point.name: xyz for point, xyz in zip(a.network.points, a.state.xyz, strict=True)}


def _state_in(network: Network, before: Network, state: State) -> State:
    """The state of a network after some of its points were taken out."""
    place = {point.name: i for i, point in enumerate(before.points)}
    return replace(state, xyz=state.xyz[[place[point.name] for point in network.points]])


def _adjusted_words(outcome: Outcome) -> str:
    a = outcome.adjustment
    sigma0 = "not estimable" if a.sigma0 is None else f"{a.sigma0:.4g}"
    return (
        f"{a.problem.n_observations} observations, redundancy {a.redundancy}, "
        f"sigma0 {sigma0} (a priori {a.network.sigma0:g})"
    )


def _findings(outcome: Outcome) -> tuple[Finding, ...]:
    gone = [Finding(describe(removed.network, removed.blunder), removed=True) for removed in outcome.removed]
    network = outcome.adjustment.network
    return (*gone, *(Finding(describe(network, blunder), removed=False) for blunder in outcome.blunders))
