"""Pose estimation on the hill (paper, step 2) with the search for gross errors in three stages.

1. Free adjustment of the images alone: shows gross errors of image coordinates, independently of the survey.
2. Similarity transformation of the free block onto the reference points: shows gross errors of the survey.
3. Adjustment with the reference coordinates as weighted observations (D3b): shows the remaining gross errors, with the
   strongest geometry.

An observation that a stage takes out stays out. The tie points are the static ones (alternative 1) or these and the
places of moving ones such as the helmet (alternative 2, footnote 3).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from fnmatch import fnmatchcase

import numpy as np

from photogrammetry.adjustment.equations.unknowns import State, state_of
from photogrammetry.adjustment.gross_errors.blunders import (
    Blunder,
    BlunderKind,
    Observation,
    Removed,
    describe,
    observation_to_json,
)
from photogrammetry.adjustment.gross_errors.suspicion import FAMILY_RISK
from photogrammetry.adjustment.run import Outcome, adjust
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.geometry.similarity import Similarity
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.network.model import Datum, Network, Role
from photogrammetry.network.selection import (
    as_check_points,
    observation_names,
    only_points,
    require_unknown_poses,
    without_observations,
    without_survey,
)
from photogrammetry.procedures.reference_estimate import Suspect
from photogrammetry.procedures.reference_fit import ReferenceFit, fit_reference, reference_points
from photogrammetry.start_values.search import complete
from rig.errors import BadInputError

_SURVEYED = (Role.CONTROL, Role.FIXED)
#: Probability that a stage suspects anything in sound data; all three together have that of one adjustment.
_STAGE_RISK = FAMILY_RISK / 3


class StageName(StrEnum):
    """The stages, in their order."""

    FREE = "free adjustment"
    SIMILARITY = "similarity transformation onto the reference points"
    CONSTRAINED = "constrained adjustment"


@dataclass(frozen=True, slots=True)
class Finding:
    """A gross error that a stage found.

    Attributes:
        message: names the observation, with its tests.
        removed: whether it was taken out.
    """

    message: str
    removed: bool


@dataclass(frozen=True, slots=True)
class PointTest:
    """A reference point in the similarity transformation.

    Attributes:
        point: its name.
        v: transformed - surveyed, X, Y, Z.
        r: redundancy numbers.
        w: test values; NaN where nothing controls a coordinate.
    """

    point: str
    v: tuple[float, ...]
    r: tuple[float, ...]
    w: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """One stage.

    Attributes:
        name: of the stage.
        words: its figures, or why it was left out.
        findings: its gross errors, in the order found.
        tests: of the reference points, in the similarity transformation only.
    """

    name: StageName
    words: str
    findings: tuple[Finding, ...] = ()
    tests: tuple[PointTest, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Orientation:
    """The oriented images.

    Attributes:
        outcome: the constrained adjustment; `removed` has the observations that all stages took out.
        stages: the three stages.
        notes: changes that were made to the network.
    """

    outcome: Outcome
    stages: tuple[Stage, ...]
    notes: tuple[str, ...]


def orient(
    network: Network, alternative: int = 2, moving: str = "H*", *, uncertain_interior: bool = False
) -> Orientation:
    """Estimate the poses of all images; interior orientations are constant, unless they are uncertain.

    Args:
        network: images, reference points and tie points.
        alternative: 1: static tie points alone; 2: moving ones too.
        moving: pattern of the moving points' names (`*` and `?`).
        uncertain_interior: interior parameters that a camera estimates and whose given value has a sigma are weighted
            observations, so that their uncertainty is in that of the poses. All others are held in any case.

    Raises:
        BadInputError: the network has no images, a constant pose, or no moving point where alternative 1 leaves
            them out.
        NotSolvableError, NotConvergedError: of the constrained adjustment.
    """
    network, held = _with_interior(network, uncertain_interior)
    network, notes = _prepared(network, alternative, moving)
    notes = held + notes
    free, removed, stage = _free_stage(network)
    stages = [stage]
    cleaned = _cleaned(network, removed)
    start: State | None = None
    if free is None:
        stages.append(Stage(StageName.SIMILARITY, "left out: there is no free block"))
    else:
        fit, wrong, stage = _similarity_stage(cleaned, _without_suspects(free))
        stages.append(stage)
        removed = [*removed, *wrong]
        cleaned = _cleaned(network, removed)
        start = None if fit is None else _carried(cleaned, free, fit.estimate.transform)
    outcome = adjust(
        cleaned, state_of(complete(cleaned)) if start is None else start, snoop=True, family_risk=_STAGE_RISK
    )
    stages.append(Stage(StageName.CONSTRAINED, _adjusted_words(outcome), _findings(outcome)))
    return Orientation(replace(outcome, removed=(*removed, *outcome.removed)), tuple(stages), tuple(notes))


def _with_interior(network: Network, uncertain: bool) -> tuple[Network, list[str]]:
    """The network with the interior parameters that are constant held."""
    cameras, held = [], []
    for camera in network.cameras:
        open_ones = tuple(name for name in camera.estimate if uncertain and name in camera.sigma)
        if open_ones != camera.estimate:
            held.append(camera.name)
        sigma = {name: camera.sigma[name] for name in open_ones}
        cameras.append(replace(camera, estimate=open_ones, sigma=sigma))
    words = f"interior orientation held as it is given, although the file estimates it: {', '.join(held)}"
    return replace(network, cameras=tuple(cameras)), [words] if held else []


def _prepared(network: Network, alternative: int, moving: str) -> tuple[Network, list[str]]:
    """The network with the tie points of the alternative."""
    notes = []
    require_unknown_poses(network, "orientation")
    network = replace(network, datum=Datum())
    moves = np.array([p.role is Role.TIE and fnmatchcase(p.name, moving) for p in network.points], dtype=bool)
    if alternative == 1:
        if not moves.any():
            raise BadInputError(
                f'no tie point is called "{moving}", so alternative 1 has none to leave out; name the moving points '
                "with --moving, or use alternative 2"
            )
        network = only_points(network, ~moves)
        notes.append(f"alternative 1: {int(moves.sum())} moving points left out, static points tie the images alone")
    else:
        count = f"{int(moves.sum())} moving points tie" if moves.any() else "no moving point ties"
        notes.append(f"alternative 2: {count} the images beside the static ones")
    return network, notes


def _free_stage(network: Network) -> tuple[Outcome | None, list[Removed], Stage]:
    """Adjust the images alone; None if they do not determine a block."""
    alone = without_survey(network)
    try:
        outcome = adjust(alone, state_of(complete(alone)), snoop=True, family_risk=_STAGE_RISK)
    except (BadInputError, NotSolvableError, NotConvergedError) as error:
        return None, [], Stage(StageName.FREE, f"left out: the images alone do not form a block ({error})")
    return outcome, list(outcome.removed), Stage(StageName.FREE, _adjusted_words(outcome), _findings(outcome))


def _similarity_stage(network: Network, free: Outcome) -> tuple[ReferenceFit | None, list[Removed], Stage]:
    """Carry the free block onto the reference points; None if there are too few of them."""
    a = free.adjustment
    place = {point.name: i for i, point in enumerate(a.network.points)}
    surveyed = [
        i for i, p in enumerate(network.points) if p.role in _SURVEYED and p.xyz is not None and p.name in place
    ]
    try:
        fit = fit_reference(*reference_points(a, [network.points[i] for i in surveyed]), _STAGE_RISK)
    except BadInputError as error:
        return None, [], Stage(StageName.SIMILARITY, f"left out: {error}")
    wrong = [Removed(_blunder(suspect, surveyed, network, a), network) for suspect in fit.removed]
    findings = [
        Finding(f"{describe(gone.network, gone.blunder)}; {_tests_of(suspect)}", removed=True)
        for gone, suspect in zip(wrong, fit.removed, strict=True)
    ]
    if fit.suspect is not None:
        words = describe(network, _blunder(fit.suspect, surveyed, network, a))
        findings.append(Finding(f"{words}; {_tests_of(fit.suspect)}", removed=False))
    estimate = fit.estimate
    v = estimate.v.reshape(-1, 3)
    words = (
        f"{len(estimate.used)} reference points, redundancy {estimate.redundancy}, residuals rms X Y Z "
        + " ".join(f"{value:.3g}" for value in np.sqrt(np.mean(v**2, axis=0)))
        + f" {network.length_unit}, sigma0 {estimate.ratio:.3g} (a priori 1)"
    )
    figures = (v.tolist(), estimate.controlled.tolist(), estimate.w.tolist())
    tests = tuple(
        PointTest(network.points[surveyed[i]].name, *(tuple(values) for values in rows))
        for i, *rows in zip(estimate.used, *figures, strict=True)
    )
    return fit, wrong, Stage(StageName.SIMILARITY, words, tuple(findings), tests)


def _tests_of(suspect: Suspect) -> str:
    """The tests of a reference point's coordinates in words."""
    w, r = (" ".join(f"{value:.2f}" for value in values) for values in (suspect.single, suspect.controlled))
    return f"w of X, Y, Z {w}, redundancy numbers {r}"


def _without_suspects(free: Outcome) -> Outcome:
    """The free block without the undecided candidates, which might deform it; unchanged if it needs them."""
    if not free.blunders:
        return free
    network = free.adjustment.network
    suspects = {candidate for blunder in free.blunders for candidate in (blunder.suspect, *blunder.candidates)}
    named = [observation_to_json(network, suspect) for suspect in suspects]
    less = without_survey(without_observations(network, {(names["image"], names["point"]) for names in named}))
    try:
        return adjust(less, state_of(complete(less)), family_risk=_STAGE_RISK)
    except (BadInputError, NotSolvableError, NotConvergedError):
        return free


def _blunder(suspect: Suspect, surveyed: Sequence[int], network: Network, free: Adjustment) -> Blunder:
    """A wrong reference point in the form of the adjustment's blunders."""
    rows = {names: i for i, names in enumerate(observation_names(network))}
    names = observation_names(free.network)
    itself = Observation(BlunderKind.CONTROL, surveyed[suspect.index])
    others = [Observation(BlunderKind.CONTROL, surveyed[i]) for i in suspect.candidates if i != suspect.index]
    others += [Observation(BlunderKind.IMAGE, rows[names[i]]) for i in suspect.images]
    candidates = () if suspect.certain else (itself, *others)
    return Blunder(itself, suspect.estimate, suspect.w, suspect.certain, candidates)


def _cleaned(network: Network, removed: Sequence[Removed]) -> Network:
    """The network without the removed observations, matched by name because indices differ from stage to stage."""
    named = [observation_to_json(gone.network, gone.blunder.suspect) for gone in removed]
    rows = {(n["image"], n["point"]) for n in named if n["kind"] == BlunderKind.IMAGE}
    points = {n["point"] for n in named if n["kind"] == BlunderKind.CONTROL}
    return as_check_points(without_observations(network, rows), points)


def _carried(network: Network, free: Outcome, transform: Similarity) -> State | None:
    """Start values from the free block; None if it lacks a tie point."""
    state, place = free.adjustment.state, {p.name: i for i, p in enumerate(free.adjustment.network.points)}
    xyz = [transform.apply(state.xyz[place[p.name]]) if p.name in place else p.xyz for p in network.points]
    if any(known is None for known in xyz):
        return None
    return State(
        np.array([camera.interior for camera in network.cameras], dtype=float),
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
