"""The first stage: adjusts the images alone, and carries their block into the object system."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from photogrammetry.adjustment.equations.unknowns import State, state_of
from photogrammetry.adjustment.gross_errors.blunders import BlunderKind, Removed, describe, observation_to_json
from photogrammetry.adjustment.run import Outcome, adjust
from photogrammetry.adjustment.solution.global_test import ABSURD
from photogrammetry.geometry.similarity import Similarity, fit_similarity
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.network.model import Network, Role
from photogrammetry.network.selection import (
    RAYS,
    as_check_points,
    only_points,
    rays,
    without_observations,
    without_survey,
)
from photogrammetry.procedures.findings import STAGE_RISK, SURVEYED, Finding, Stage, StageName
from photogrammetry.start_values.search import complete
from rig.arrays import Floats
from rig.errors import BadInputError

#: Observations of points.
OF_POINTS: Final = (BlunderKind.IMAGE, BlunderKind.CONTROL)


def free_stage(network: Network) -> tuple[Outcome | None, list[Removed], Stage]:
    """Adjust the images alone; None if they do not determine a block."""
    try:
        outcome = _alone(without_survey(network))
    except (BadInputError, NotSolvableError, NotConvergedError) as error:
        return None, [], Stage(StageName.FREE, f"left out: the images alone do not form a block ({error})")
    return outcome, list(outcome.removed), Stage(StageName.FREE, adjusted_words(outcome), findings_of(outcome))


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


def without_suspects(free: Outcome) -> Outcome:
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


def without_removed(network: Network, removed: Sequence[Removed]) -> Network:
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
    touched = {n["point"] for n in named if n["kind"] in OF_POINTS}
    lonely = np.array(
        [
            p.name in touched and p.role not in SURVEYED and n < RAYS
            for p, n in zip(left.points, rays(left), strict=True)
        ],
        dtype=bool,
    )
    return only_points(left, ~lonely) if lonely.any() else left


def carried(network: Network, block: Outcome, free: Outcome, transform: Similarity) -> State | None:
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


def state_in(network: Network, before: Network, state: State) -> State:
    """The state of a network after some of its points were taken out."""
    place = {point.name: i for i, point in enumerate(before.points)}
    return replace(state, xyz=state.xyz[[place[point.name] for point in network.points]])


def adjusted_words(outcome: Outcome) -> str:
    """The figures of an adjustment, for its stage."""
    a = outcome.adjustment
    sigma0 = "not estimable" if a.sigma0 is None else f"{a.sigma0:.4g}"
    return (
        f"{a.problem.n_observations} observations, redundancy {a.redundancy}, "
        f"sigma0 {sigma0} (a priori {a.network.sigma0:g})"
    )


def findings_of(outcome: Outcome) -> tuple[Finding, ...]:
    """The gross errors of an adjustment: those that were taken out, then those that are suspected."""
    gone = [Finding(describe(removed.network, removed.blunder), removed=True) for removed in outcome.removed]
    network = outcome.adjustment.network
    return (*gone, *(Finding(describe(network, blunder), removed=False) for blunder in outcome.blunders))
