"""What a gross error is: the observation, how wrong it is, and what it may be instead."""

from dataclasses import dataclass
from enum import StrEnum

from photogrammetry.adjustment.state import Floats


class BlunderKind(StrEnum):
    """Kind of observation."""

    IMAGE = "image"
    CONTROL = "control"
    DISTANCE = "distance"
    DIFFERENCE = "difference"


@dataclass(frozen=True, slots=True)
class Observation:
    """One observation: index of the image observation, control point, distance or difference in the network."""

    kind: BlunderKind
    index: int


@dataclass(frozen=True, slots=True, eq=False)
class Blunder:
    """A suspected gross error.

    Attributes:
        suspect: the observation with the largest test value.
        estimate: observed - true, one number per coordinate, metric frame, in the observation's unit.
        w: test value; of an image point that of its worse coordinate.
        locatable: whether the data can tell that it is this one.
        candidates: those that it may be instead, the suspect first; empty if it is locatable.
    """

    suspect: Observation
    estimate: Floats
    w: float
    locatable: bool
    candidates: tuple[Observation, ...]
