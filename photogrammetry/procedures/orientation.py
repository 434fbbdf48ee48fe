"""Pose estimation on the hill (paper, step 2) with the search for gross errors in three stages (`stages`).

The tie points are the static ones (alternative 1) or these and the places of moving ones such as the helmet
(alternative 2, footnote 3).
"""

from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import Final

import numpy as np

from photogrammetry.adjustment.equations.unknowns import state_of
from photogrammetry.adjustment.run import Outcome, settled
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError, RefusedError
from photogrammetry.network.model import Datum, Network, Role
from photogrammetry.network.selection import only_points, require_unknown_poses
from photogrammetry.procedures.doubtful_poses import refuse_ambiguous, refuse_contradicted
from photogrammetry.procedures.findings import Stage
from photogrammetry.procedures.left_out import START_CAUTION, unplaced_points, without_images, without_points
from photogrammetry.procedures.stages import by_survey_alone, constrained_stage, search_block
from photogrammetry.start_values.search import complete
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase

_MOVING: Final = "H*"  # helmet


@dataclass(frozen=True, slots=True, eq=False)
class Orientation:
    """The oriented images.

    Attributes:
        outcome: the constrained adjustment; `removed` has the observations that all stages took out.
        stages: the three stages.
        notes: changes that were made to the network.
        left_out: those of them that nobody asked for: images and tie points without which it was oriented.
    """

    outcome: Outcome
    stages: tuple[Stage, ...]
    notes: tuple[str, ...]
    left_out: tuple[Phrase, ...] = ()


def orient(
    network: Network, alternative: int = 2, moving: str | None = None, *, uncertain_interior: bool = False
) -> Orientation:
    """Estimate the poses of all images; interior orientations are constant, unless they are uncertain.

    Args:
        network: images, reference points and tie points.
        alternative: 1: static tie points alone; 2: moving ones too.
        moving: pattern of the moving points' names (`*` and `?`); None: `H*`, if there are such ones.
        uncertain_interior: interior parameters that a camera estimates and whose given value has a sigma are weighted
            observations: their uncertainty is part of the poses'. All others are held in any case.

    Raises:
        BadInputError: the network has no images, a constant pose, or no point of the moving ones that are named.
        NotSolvableError, NotConvergedError: of the constrained adjustment; NotSolvableError also of an image that three
            points alone fix in several ways.
        RefusedError: images and survey contradict each other so much that no result can be believed.
    """
    if not network.images:
        raise BadInputError(
            "the network has no images, so there is no pose to estimate; add the images and what they show"
        )
    network, held = _with_interior(network, uncertain_interior)
    network, notes = _prepared(network, alternative, moving)
    outcome, stages, left_out = _oriented(network)
    outcome = replace(outcome, adjustment=replace(outcome.adjustment, cautious=True))
    refuse_ambiguous(network, outcome.adjustment)
    refuse_contradicted(network, outcome.adjustment)
    return Orientation(outcome, stages, (*held, *notes, *map(str, left_out)), tuple(left_out))


def _oriented(network: Network) -> tuple[Outcome, tuple[Stage, ...], list[Phrase]]:
    """The three stages; where they fail, without images that nothing orients and ties that their rays do not place."""
    gone: dict[str, str] = {}
    said: list[Phrase] = []
    while True:
        try:
            outcome, stages = _in_stages(without_points(network, gone))
        except (NotSolvableError, NotConvergedError, RefusedError) as failure:
            less = without_images(network, failure)
            if less is not None:
                network = less[0]
                said += less[1]
                continue
            left = without_points(network, gone)
            more = unplaced_points(left, state_of(complete(left)), START_CAUTION)
            if not more:
                raise
        else:
            # a point that has nearly no place bends the free block, in whose system it counts like the others
            more = unplaced_points(outcome.adjustment.network, outcome.adjustment.state)
            if not more:
                break
        gone |= more
    # what the start values did not place, the adjusted poses may
    if back := set(gone) - set(unplaced_points(network, outcome.adjustment.state)):
        try:
            outcome, stages = _in_stages(without_points(network, gone.keys() - back))
            gone = {name: words for name, words in gone.items() if name not in back}
        except (NotSolvableError, NotConvergedError, RefusedError):
            pass  # they do not fit
    text = "point {point} is left out: {why}"
    left_out = [phrase("left_out_point", text, point=name, why=words) for name, words in gone.items()]
    return outcome, stages, [*said, *left_out]


def _in_stages(network: Network) -> tuple[Outcome, tuple[Stage, ...]]:
    """The three stages.

    Few rays form a block nearly anywhere. So where observations are taken out, the survey alone leads to start values
    as well, and the result that takes out less is given.
    """
    search = search_block(network)
    outcome, stage = constrained_stage(search)
    stages = (*search.stages, stage)
    if search.stages and _taken_out(outcome):  # without them the survey alone has led here
        try:
            other, stage = constrained_stage(by_survey_alone(network))
        except (BadInputError, NotSolvableError, NotConvergedError, RefusedError):
            return settled(outcome), stages
        if _taken_out(other) < _taken_out(outcome):
            return settled(other), (stage,)
    return settled(outcome), stages


def _taken_out(outcome: Outcome) -> int:
    return len(outcome.removed) + len(outcome.aside)


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


def _prepared(network: Network, alternative: int, moving: str | None) -> tuple[Network, list[str]]:
    """The network with the tie points of the alternative."""
    notes = []
    require_unknown_poses(network, "orientation")
    network = replace(network, datum=Datum())
    moves = np.array(
        [p.role is Role.TIE and fnmatchcase(p.name, moving or _MOVING) for p in network.points], dtype=bool
    )
    if alternative == 1:
        if moving is not None and not moves.any():
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
