"""Data snooping: takes out the gross errors that can be located, the worst first, one at a time.

The linear tests name a suspect and its rivals, the candidates. Trial adjustments, one without each candidate, decide.
The suspect is the candidate whose removal lowers vTPv most. It is taken out if it stays significant without any one of
the other candidates.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy import special

from photogrammetry.adjustment.equations.problem import build_problem
from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.gross_errors.blunders import (
    Blunder,
    BlunderKind,
    Observation,
    Removed,
    describe,
    index_without,
    without,
)
from photogrammetry.adjustment.gross_errors.robust import linearised_at, robust_state
from photogrammetry.adjustment.gross_errors.suspicion import SINGLE_RISK, find_blunders, still_found
from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.geometry.camera_model import residuals
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.network.model import Network
from rig.arrays import Floats
from rig.phrase import phrase
from rig.phrases import in_turn

Trial = Adjustment | NotSolvableError | NotConvergedError

#: Snooping stops when this part of all observations has been taken out: the cause is not single observations then.
_MOST_REMOVED = 0.1
#: Above this ratio of the estimated to the a-priori sigma0, errors may have shifted the optimum.
BENT = 2.0
_NAMED = 3  # suspects in an error message, at most
_COMPARED = 3  # locatable blunders that are compared if the optimum is shifted
_MOST_TRIALS = 12  # candidates; with more of them no trial is made
#: Significant decrease of vTPv for 1, 2 and 3 coordinates: makes observations of different kinds comparable.
_BY_CHANCE = special.chdtri(np.array([1.0, 2.0, 3.0]), SINGLE_RISK)


def snoop(
    network: Network, start: State, family_risk: float
) -> tuple[Adjustment, tuple[Blunder, ...], tuple[Removed, ...]]:
    """Take out gross errors until none is left that can be located.

    Args:
        network: with all observations.
        start: start values.
        family_risk: probability that all tests together suspect anything in sound data.

    Returns:
        The adjustment without gross errors, suspected errors that cannot be located, and the observations taken out, in
        this order.

    Raises:
        NotSolvableError: a rank defect.
        NotConvergedError: no optimum, and the cause cannot be located.
    """
    removed: list[Removed] = []
    most = int(_MOST_REMOVED * build_problem(network).n_observations)
    current = _adjusted(network, start)
    while True:
        view = point_of_view(network, start, current)
        left, located = _judged_all(view, family_risk)
        if located is None or len(removed) >= most:
            break
        blunder, current = located
        removed.append(Removed(blunder, network))
        network, start = current.network, current.state
    if isinstance(current, NotConvergedError):
        raise _named(current, network, left)
    return current, tuple(left), tuple(removed)


def point_of_view(network: Network, start: State, current: Adjustment | NotConvergedError) -> Adjustment:
    """The adjustment to test: at the optimum, or linearised at the robust solution if the optimum may be shifted.

    Raises:
        NotConvergedError: there is no optimum, and no robust solution either.
    """
    if isinstance(current, Adjustment) and current.ratio <= BENT:
        return current
    try:
        return linearised_at(network, robust_state(network, start))
    except (NotSolvableError, NotConvergedError):
        if isinstance(current, Adjustment):
            return current
        raise current from None


def suspicions(adjustment: Adjustment, start: State, family_risk: float) -> list[Blunder]:
    """Suspected gross errors of an adjustment whose optimum they may have shifted.

    Args:
        adjustment: with all observations.
        start: where it started.
        family_risk: probability that all tests together suspect anything in sound data.
    """
    found = find_blunders(adjustment, family_risk)
    if not found or adjustment.ratio <= BENT:
        return found
    return find_blunders(point_of_view(adjustment.network, start, adjustment), family_risk)


def explained(error: NotConvergedError, network: Network, start: State, family_risk: float) -> NotConvergedError:
    """The error with the suspects that prevent an optimum, if any are found."""
    left, located = _judged_all(point_of_view(network, start, error), family_risk)
    return _named(error, network, left if located is None else [located[0]])


def _named(error: NotConvergedError, network: Network, suspects: Sequence[Blunder]) -> NotConvergedError:
    if not suspects:
        return error
    what = in_turn([describe(network, suspect) for suspect in suspects[:_NAMED]])
    text = "no optimum, because something is grossly wrong: {what}"
    return NotConvergedError(phrase("unconverged_wrong", text, what=what))


def _adjusted(network: Network, start: State) -> Adjustment | NotConvergedError:
    try:
        return adjust_once(network, start)
    except NotConvergedError as error:
        return error


def _judged_all(view: Adjustment, family_risk: float) -> tuple[list[Blunder], tuple[Blunder, Adjustment] | None]:
    """The blunders that cannot be located, and the worst that can, with the adjustment without it.

    If the optimum is shifted, consequences may look worse than their cause: then the blunder whose removal gives the
    smallest sigma0 counts as the worst.
    """
    trials: dict[Observation, Trial] = {}
    left: list[Blunder] = []
    located: list[tuple[Blunder, Adjustment]] = []
    for blunder in find_blunders(view, family_risk):
        if any(blunder.suspect in other.candidates for other in left):
            continue
        judged = _judged(view, blunder, trials)
        trial = trials.get(judged.suspect)
        if not judged.locatable or not isinstance(trial, Adjustment):
            left.append(judged)
            continue
        located.append((judged, trial))
        if view.ratio <= BENT or len(located) == _COMPARED:
            break
    return left, min(located, key=lambda one: one[1].ratio) if located else None


def _judged(view: Adjustment, blunder: Blunder, trials: dict[Observation, Trial]) -> Blunder:
    """The blunder as trial adjustments without each candidate show it; these are added to `trials`."""
    candidates = blunder.candidates or (blunder.suspect,)
    if len(candidates) > _MOST_TRIALS:
        return blunder
    for candidate in candidates:
        if candidate not in trials:
            trials[candidate] = _trial(view, candidate)
    possible = {c: trial for c in candidates if isinstance(trial := trials[c], Adjustment)}
    if not possible:
        return replace(blunder, locatable=False, candidates=candidates)
    variance = min(trial.ratio for trial in possible.values()) ** 2
    best = min(possible, key=lambda candidate: _left_over(view, possible[candidate], variance))
    rivals = [c for c in candidates if c != best and not _found_without(trials[c], c, best)]
    estimate = _error(view.network, best, possible[best].state)
    return Blunder(best, estimate, blunder.w, not rivals, (best, *rivals) if rivals else ())


def _trial(view: Adjustment, gone: Observation) -> Trial:
    """The adjustment without one observation, or the error why there is none."""
    network = without(view.network, gone)
    try:
        return adjust_once(network, view.state)
    except NotSolvableError as error:
        return error
    except NotConvergedError:
        pass  # it may converge from the robust solution
    try:
        return adjust_once(network, robust_state(network, view.state))
    except (NotSolvableError, NotConvergedError) as error:
        return error


def _left_over(adjustment: Adjustment, trial: Adjustment, variance: float) -> float:
    """VTPv of a trial, made comparable between observations of one, two and three coordinates."""
    parts = adjustment.problem.n_observations - trial.problem.n_observations
    return trial.equations.square_sum + float(_BY_CHANCE[parts - 1]) * variance


def _found_without(trial: Trial, gone: Observation, suspect: Observation) -> bool:
    """Whether the suspect is still significant without the observation `gone`."""
    if isinstance(trial, Adjustment):
        return still_found(trial, index_without(suspect, gone))
    # No optimum: a gross error is still in. Not solvable: the removed observation is needed, and may be the wrong one.
    return isinstance(trial, NotConvergedError)


def _error(network: Network, gone: Observation, state: State) -> Floats:
    """Observed - true, by the adjustment without the observation."""
    i = gone.index
    match gone.kind:
        case BlunderKind.IMAGE:
            o = network.observations
            image, point = int(o.image[i]), int(o.point[i])
            camera = network.images[image].camera
            lens = replace(network.cameras[camera], interior=state.interior[camera]).lens()
            pose = state.rotation[image], state.position[image]
            return np.asarray(-residuals(lens, *pose, state.xyz[point], o.xy[i]), dtype=float)
        case BlunderKind.CONTROL:
            return np.asarray(np.array(network.points[i].xyz, dtype=float) - state.xyz[i])
        case BlunderKind.DISTANCE:
            distance = network.distances[i]
            return np.array([distance.value - np.linalg.norm(state.xyz[distance.end] - state.xyz[distance.start])])
        case _:
            step = network.differences[i]
            return np.array([step.value - (state.xyz[step.end, step.axis] - state.xyz[step.start, step.axis])])
