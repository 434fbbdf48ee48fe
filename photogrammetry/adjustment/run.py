"""The whole of an adjustment as a network file asks for it: weights, gross errors, variance components."""

from dataclasses import dataclass, replace

import numpy as np

from photogrammetry.adjustment.adjustment import Adjustment, adjust_once
from photogrammetry.adjustment.blunders import Blunder, BlunderKind, Observation, find_blunders
from photogrammetry.adjustment.state import State
from photogrammetry.adjustment.variance_components import Component, estimate_by_paper, estimate_components
from photogrammetry.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.network import Network, Reweight, Role
from rig.errors import BadInputError

#: Snooping stops when this part of all observations has been taken out: something else is wrong then.
_MOST_REMOVED = 0.1


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
    adjustment = adjust_once(network, start)
    if not adjustment.problem.n_observations:
        raise BadInputError("the network has no observations: nothing to adjust; add some")
    blunders = find_blunders(adjustment)
    removed: list[Removed] = []
    if snoop:
        adjustment, blunders, removed = _snooped(adjustment, blunders)
    components: tuple[Component, ...] | None
    if network.reweight is Reweight.NONE:
        try:
            components, _ = estimate_components(adjustment)
        except NotConvergedError:
            components = None
    else:
        estimate = estimate_by_paper if network.reweight is Reweight.PAPER else estimate_components
        components, adjustment = estimate(adjustment)
        blunders = find_blunders(adjustment)
    return Outcome(adjustment, tuple(blunders), components, tuple(removed))


def _snooped(adjustment: Adjustment, blunders: list[Blunder]) -> tuple[Adjustment, list[Blunder], list[Removed]]:
    """Data snooping: one at a time, because the others may be its consequences."""
    removed: list[Removed] = []
    most = int(_MOST_REMOVED * adjustment.problem.n_observations)
    while len(removed) < most:
        # What cannot be located may stand behind everything smaller: no further accusations then.
        worst = blunders[0] if blunders and blunders[0].locatable else None
        if worst is None:
            break
        try:
            adjusted = adjust_once(without(adjustment.network, worst.suspect), adjustment.state)
        except (NotSolvableError, NotConvergedError):
            break
        removed.append(Removed(worst, adjustment.network))
        adjustment, blunders = adjusted, find_blunders(adjusted)
    return adjustment, blunders, removed


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
