"""The whole of an adjustment as a network file asks for it: weights, gross errors, variance components."""

from dataclasses import dataclass, replace

import numpy as np

from photogrammetry.adjustment.adjustment import Adjustment, adjust_once
from photogrammetry.adjustment.blunders import Blunder, BlunderKind, Observation, find_blunders
from photogrammetry.adjustment.misfits import find_misfits
from photogrammetry.adjustment.state import State, state_of
from photogrammetry.adjustment.variance_components import Component, estimate_by_paper, estimate_components
from photogrammetry.adjustment.wording import name_of
from photogrammetry.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.network import Network, Reweight, Role
from rig.errors import BadInputError

#: Snooping stops when this part of all observations has been taken out: something else is wrong then.
_MOST_REMOVED = 0.1
#: Test value that a blunder must keep beside any other to be taken out where a larger one cannot be located.
_CERTAIN = 3.29
_NAMED = 5  # so many misfits stand in an error message


@dataclass(frozen=True, slots=True, eq=False)
class Removed:
    """An observation that snooping took out, by names (indices change when an observation goes).

    Attributes:
        blunder: what was found.
        network: the network whose indices it speaks of.
    """

    blunder: Blunder
    network: Network


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """An adjusted network with everything that is reported of it.

    Attributes:
        adjustment: with the weights the network asks for.
        blunders: suspected gross errors, the largest test value first.
        components: variance components; None where they do not settle.
        removed: what snooping took out, in that order.
    """

    adjustment: Adjustment
    blunders: tuple[Blunder, ...]
    components: tuple[Component, ...] | None
    removed: tuple[Removed, ...] = ()


def adjust(network: Network, start: State | None = None, *, snoop: bool = False) -> Outcome:
    """Adjust a network as it asks for.

    Args:
        network: the network; its values are the observed ones where they have a sigma.
        start: start values of everything; the network's own if left out.
        snoop: take the worst locatable gross error out and adjust again, until there is none.

    Returns:
        The adjusted network with tests and variance components.

    Raises:
        NotSolvableError: a rank defect; says which unknowns and why.
        NotConvergedError: no optimum was reached, or weights that were asked for do not settle.
        BadInputError: a start value is missing, or too few control points for the paper's D5.
    """
    adjustment, removed = _first(network, state_of(network) if start is None else start, snoop=snoop)
    if not adjustment.problem.n_observations:
        raise BadInputError("the network has no observations: nothing to adjust; add some")
    blunders = find_blunders(adjustment)
    if snoop:
        adjustment, blunders, further = _snooped(adjustment, blunders)
        removed += further
    components: tuple[Component, ...] | None
    if network.reweight is Reweight.NONE:
        try:
            components, _ = estimate_components(adjustment)
        except (NotConvergedError, NotSolvableError):
            components = None  # the adjustment stands; only the weights cannot be estimated
    else:
        estimate = estimate_by_paper if network.reweight is Reweight.PAPER else estimate_components
        components, adjustment = estimate(adjustment)
        blunders = find_blunders(adjustment)
    return Outcome(adjustment, tuple(blunders), components, tuple(removed))


def _first(network: Network, start: State, *, snoop: bool) -> tuple[Adjustment, list[Removed]]:
    """Adjust; where that does not converge, say which observations are to blame, or take them out if that is wanted."""
    try:
        return adjust_once(network, start), []
    except NotConvergedError as error:
        misfits, state = find_misfits(network, start)
        if not misfits:
            raise
        if not snoop:
            names = "; ".join(name_of(network, misfit.suspect) for misfit in misfits[:_NAMED])
            raise NotConvergedError(
                f"no optimum, because something is grossly wrong: {names}; measure again, or let --snoop take it out"
            ) from error
    removed = []
    for misfit in sorted(misfits, key=lambda misfit: -misfit.suspect.index):  # from behind: indices in front stay
        removed.append(Removed(misfit, network))
        network = without(network, misfit.suspect)
    return adjust_once(network, state), removed


def _snooped(adjustment: Adjustment, blunders: list[Blunder]) -> tuple[Adjustment, list[Blunder], list[Removed]]:
    """Data snooping: one at a time, because the others may be its consequences."""
    removed: list[Removed] = []
    most = int(_MOST_REMOVED * adjustment.problem.n_observations)
    while len(removed) < most:
        worst = _most_certain(blunders)
        if worst is None:
            break
        try:
            adjusted = adjust_once(without(adjustment.network, worst.suspect), adjustment.state)
        except (NotSolvableError, NotConvergedError):
            break
        removed.append(Removed(worst, adjustment.network))
        adjustment, blunders = adjusted, find_blunders(adjusted)
    return adjustment, blunders, removed


def _most_certain(blunders: list[Blunder]) -> Blunder | None:
    """The worst blunder that can be located, and is no consequence of a larger one that cannot."""
    needed = 0.0
    for blunder in blunders:
        if blunder.locatable and blunder.margin > needed:
            return blunder
        needed = _CERTAIN
    return None


def without(network: Network, observation: Observation) -> Network:
    """The network without one observation; a control point becomes a check point."""
    i = observation.index
    match observation.kind:
        case BlunderKind.IMAGE:
            o = network.observations
            left = np.arange(len(o.image)) != i
            parts = {name: getattr(o, name)[left] for name in ("image", "point", "xy", "sigma", "group")}
            return replace(network, observations=replace(o, **parts))
        case BlunderKind.CONTROL:
            point = replace(network.points[i], role=Role.CHECK, sigma=None)
            return replace(network, points=(*network.points[:i], point, *network.points[i + 1 :]))
        case BlunderKind.DISTANCE:
            return replace(network, distances=network.distances[:i] + network.distances[i + 1 :])
        case _:
            return replace(network, differences=network.differences[:i] + network.differences[i + 1 :])
