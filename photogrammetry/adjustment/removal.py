"""A network without one of its observations."""

from dataclasses import dataclass, replace

import numpy as np

from photogrammetry.adjustment.blunders import Blunder, BlunderKind, Observation
from photogrammetry.network import Network, Role


@dataclass(frozen=True, slots=True, eq=False)
class Removed:
    """An observation that was taken out.

    Attributes:
        blunder: what was found.
        network: the network whose indices it speaks of (they change when an observation goes).
    """

    blunder: Blunder
    network: Network


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


def index_without(observation: Observation, gone: Observation) -> Observation:
    """Another observation as it is numbered once `gone` is out."""
    shifts = observation.kind is gone.kind and gone.kind is not BlunderKind.CONTROL
    return (
        replace(observation, index=observation.index - 1) if shifts and observation.index > gone.index else observation
    )
