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
    BlunderKind,
    Removed,
    describe,
    observation_to_json,
)
from photogrammetry.adjustment.gross_errors.snooping import BENT
from photogrammetry.adjustment.run import Outcome, adjust
from photogrammetry.adjustment.solution.adjustment import adjust_once
from photogrammetry.adjustment.solution.global_test import ABSURD, GlobalTest, Verdict
from photogrammetry.geometry.similarity import Similarity
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
from rig.errors import BadInputError


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
    fit, wrong, second = similarity_stage(cleaned, _without_suspects(free))
    removed = (*gone, *wrong)
    cleaned = _cleaned(network, removed)
    start = None if fit is None else _carried(cleaned, free, fit.estimate.transform)
    return Search(cleaned, start, removed, (stage, second))


def constrained_stage(search: Search) -> tuple[Outcome, Stage]:
    """Adjust with what the first two stages left; the outcome names all that the three stages took out.

    Raises:
        RefusedError: the outcome is absurd.
        NotSolvableError, NotConvergedError: of the adjustment.
    """
    network, start, lonely = search.network, search.start, []
    if start is not None:
        lonely = contradicted_rays(network, start)
        network, start = _cleaned(network, lonely), _without_points(start, lonely)
    start = state_of(complete(network)) if start is None else start
    outcome = adjust(network, start, snoop=True, family_risk=STAGE_RISK)
    outcome = replace(outcome, removed=(*lonely, *outcome.removed))
    stage = Stage(StageName.CONSTRAINED, _adjusted_words(outcome), _findings(outcome))
    outcome = replace(outcome, removed=(*search.removed, *outcome.removed))
    refuse_absurd(outcome, [finding.message for part in (*search.stages, stage) for finding in part.findings])
    return outcome, stage


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
        except NotConvergedError:
            return constrained_stage(search_block(network))[0]
        if whole.ratio > BENT:
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
    test = GlobalTest(a.ratio, a.redundancy)
    if test.verdict is Verdict.ABSURD:
        raise RefusedError(f"sigma0 is {test.words}{told_of(findings)}")
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
    named = [observation_to_json(gone.network, gone.blunder.suspect) for gone in removed]
    rows = {(n["image"], n["point"]) for n in named if n["kind"] == BlunderKind.IMAGE}
    points = {n["point"] for n in named if n["kind"] == BlunderKind.CONTROL}
    left = without_observations(network, rows)
    lonely = np.array([p.name in points and n < RAYS for p, n in zip(left.points, rays(left), strict=True)], dtype=bool)
    # without its survey nothing determines a point that one image shows
    return as_check_points(only_points(left, ~lonely) if lonely.any() else left, points)


def _carried(network: Network, free: Outcome, transform: Similarity) -> State | None:
    """Start values from the free block; None if it lacks a tie point."""
    state, place = free.adjustment.state, {p.name: i for i, p in enumerate(free.adjustment.network.points)}
    xyz = [transform.apply(state.xyz[place[p.name]]) if p.name in place else p.xyz for p in network.points]
    if any(known is None for known in xyz):
        return None
    return State(
        state.interior,
        transform.apply(state.position),
        transform.turn(state.rotation),
        np.array(
            [
                point.xyz if point.role is Role.FIXED else known
                for point, known in zip(network.points, xyz, strict=True)
            ],
            dtype=float,
        ),
    )


def _without_points(state: State, gone: Sequence[Removed]) -> State:
    """The state of a network after points with a single ray were taken out."""
    indices = [removed.blunder.suspect.index for removed in gone]
    return replace(state, xyz=np.delete(state.xyz, indices, axis=0))


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
