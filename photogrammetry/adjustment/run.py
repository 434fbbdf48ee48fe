"""Adjusts a network as its file asks for it: weights, search for gross errors, variance components."""

from dataclasses import dataclass, replace
from typing import Final

from photogrammetry.adjustment.equations.unknowns import State, state_of
from photogrammetry.adjustment.gross_errors.blunders import Blunder, Removed
from photogrammetry.adjustment.gross_errors.snooping import explained, suspicions
from photogrammetry.adjustment.gross_errors.snooping import snoop as snooped
from photogrammetry.adjustment.gross_errors.suspicion import FAMILY_RISK, find_blunders
from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.adjustment.solution.curvature import Interval, curvature
from photogrammetry.adjustment.variance_components import Component, estimate_by_paper, estimate_components
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.network.model import Network, Reweight
from rig.errors import BadInputError

_BETTER: Final = 3  # better optima that are gone to, one after the other


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """An adjusted network with its gross errors and variance components.

    Attributes:
        adjustment: with the weights the network asks for.
        blunders: suspected gross errors, the largest test value first.
        components: variance components; None where they do not settle.
        removed: the observations that snooping took out, in that order.
        aside: groups left out by the adjustment: one observation of each is wrong, and nobody knows which.
        intervals: of camera parameters whose sigma is beyond its linearisation (`settled`).
    """

    adjustment: Adjustment
    blunders: tuple[Blunder, ...]
    components: tuple[Component, ...] | None
    removed: tuple[Removed, ...] = ()
    aside: tuple[Removed, ...] = ()
    intervals: tuple[Interval, ...] = ()

    @property
    def suspected(self) -> tuple[Removed, ...]:
        """All suspected gross errors with their networks, the largest test value first, used or not."""
        used = (Removed(blunder, self.adjustment.network) for blunder in self.blunders)
        return tuple(sorted((*used, *self.aside), key=lambda one: -abs(one.blunder.w)))


def adjust(
    network: Network, start: State | None = None, *, snoop: bool = False, family_risk: float = FAMILY_RISK
) -> Outcome:
    """Adjust a network as it asks for.

    Args:
        network: the network; its values are the observed ones where they have a sigma.
        start: start values of everything; the network's own if left out.
        snoop: take out the worst locatable gross error and adjust again, until there is none.
        family_risk: chance that anything at all is suspected in sound data.

    Returns:
        The adjusted network with tests and variance components.

    Raises:
        NotSolvableError: a rank defect; says which unknowns and why.
        NotConvergedError: no optimum was reached, or weights that were asked for do not settle.
        BadInputError: a start value is missing, or too few control points for the paper's D5.
    """
    start = state_of(network) if start is None else start
    removed: tuple[Removed, ...] = ()
    if snoop:
        adjustment, blunders, removed = snooped(network, start, family_risk)
    else:
        adjustment = _adjusted(network, start, family_risk)
        blunders = tuple(suspicions(adjustment, start, family_risk))
    if not adjustment.problem.n_observations:
        raise BadInputError("the network has no observations: nothing to adjust; add some")
    components: tuple[Component, ...] | None
    if network.reweight is Reweight.NONE:
        try:
            components, _ = estimate_components(adjustment)
        except (NotConvergedError, NotSolvableError):
            components = None  # the adjustment is valid without them
    else:
        estimate = estimate_by_paper if network.reweight is Reweight.PAPER else estimate_components
        components, adjustment = estimate(adjustment)
        blunders = tuple(find_blunders(adjustment, family_risk))
    return Outcome(adjustment, blunders, components, removed)


def settled(outcome: Outcome) -> Outcome:
    """The outcome at the best optimum that the profiles of its camera parameters lead to, with what they say.

    Raises:
        NotSolvableError: the better optimum does not determine the unknowns.
    """
    shape = curvature(outcome.adjustment)
    for _ in range(_BETTER):
        if shape.better is None:
            break
        again = adjust(outcome.adjustment.network, shape.better)
        outcome = replace(again, removed=outcome.removed, aside=outcome.aside)
        shape = curvature(outcome.adjustment)
    return replace(outcome, intervals=shape.intervals)


def _adjusted(network: Network, start: State, family_risk: float) -> Adjustment:
    """Adjust; if that does not converge, raise the error with the observations that prevent it."""
    try:
        return adjust_once(network, start)
    except NotConvergedError as error:
        raise explained(error, network, start, family_risk) from error
