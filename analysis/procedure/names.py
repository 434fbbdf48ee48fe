"""Whether a jump's measurements tell which marker is which.

Helmet, hip and bindings look alike. Where few of them are found, other things that go along with the body can take the
place of the others: a helmet and two gloves are as far from each other as a helmet and bindings may be. All four at
once, or a binding on its ski, are nothing else.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from analysis.measurements.model import ImageMeasurements, JumpMeasurements
from analysis.result.model import JumperState, Status

#: What is said of a jump that was emptied.
UNTOLD: Final = (
    "which marker is which cannot be told, so none is given: no pulse shows all four, and no binding was seen on its "
    "ski; look at the overlay, and give the markers more contrast"
)
_BINDINGS: Final = (("P3", "right"), ("P4", "left"))
_FEWEST: Final = 3  #: bindings with their skis; one may be a coincidence


def names_are_told(states: Sequence[JumperState]) -> bool:
    """Whether raw states of a jump show all four points at once, several bindings with their skis, or any by hand."""
    points = [point for state in states for point in state.points.values()]
    if any(point is not None and point.status is Status.BY_HAND for point in points):
        return True
    if any(None not in state.points.values() for state in states):
        return True
    return (
        sum(state.points[p] is not None and state.skis[s] is not None for state in states for p, s in _BINDINGS)
        >= _FEWEST
    )


def emptied(jump: JumpMeasurements) -> JumpMeasurements:
    """The jump without anything measured in its images."""
    pulses = (
        replace(pulse, images={name: ImageMeasurements({}, {}) for name in pulse.images}) for pulse in jump.pulses
    )
    return replace(jump, pulses=tuple(pulses))
