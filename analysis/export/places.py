"""The points that motion files show: P1 to P4, the ends of the skis and O, raw and smoothed, pulse by pulse.

The ends of a ski are half its length from the binding, along its direction (paper, section 1). Coordinates are those of
the survey, m, Z up.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.measurements.model import POINTS, SIDES
from analysis.result.model import Jump, JumperState, PointState, SkiState, SmoothedState
from photogrammetry.jumper.stick_model import direction_of
from rig.arrays import Floats, Integers

#: The paper's ski length.
SKI_LENGTH_M: Final = 2.63
LABELS: Final = (*POINTS, *(f"{side}_{end}" for side in SIDES for end in ("tail", "tip")), "O")
#: Ending of the labels of smoothed points.
SMOOTHED: Final = "_s"
_BINDINGS: Final = dict(zip(SIDES, ("P3", "P4"), strict=True))


@dataclass(frozen=True, slots=True)
class Place:
    """A point at one pulse.

    Attributes:
        xyz: (3,) m.
        covariance: (3, 3) m^2.
        cameras: that it was measured with.
    """

    xyz: Floats
    covariance: Floats
    cameras: frozenset[str]


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """All points of a jump; one row a pulse of the recording, without a break from the first to the last.

    Attributes:
        labels: (k,) raw points, then the smoothed ones with the ending `SMOOTHED`.
        pulses: (n,) numbers of the pulses.
        xyz: (n, k, 3) m; NaN where there is none.
        sigma: (n, k, 3) m; likewise.
        cameras: (n, k) the cameras that each was measured with.
    """

    labels: tuple[str, ...]
    pulses: Integers
    xyz: Floats
    sigma: Floats
    cameras: tuple[tuple[frozenset[str], ...], ...]


def places(jump: Jump, ski_length_m: float = SKI_LENGTH_M) -> Places:
    """The points of a jump that has pulses."""
    states = {int(pulse.pulse): pulse for pulse in jump.pulses}
    pulses = np.arange(min(states), max(states) + 1)
    labels = (*LABELS, *(label + SMOOTHED for label in LABELS))
    xyz, sigma = np.full((2, len(pulses), len(labels), 3), np.nan)
    cameras: list[tuple[frozenset[str], ...]] = []
    for row, number in enumerate(pulses.tolist()):
        found: dict[str, Place] = {}
        if number in states:
            found = of_state(states[number].raw, ski_length_m)
            if (smoothed := states[number].smoothed) is not None:
                found |= {label + SMOOTHED: place for label, place in of_state(smoothed, ski_length_m).items()}
        cameras.append(tuple(found[label].cameras if label in found else frozenset() for label in labels))
        for column, label in enumerate(labels):
            if label in found:
                xyz[row, column] = found[label].xyz
                sigma[row, column] = np.sqrt(np.diagonal(found[label].covariance))
    return Places(labels, pulses, xyz, sigma, tuple(cameras))


def of_state(state: JumperState, ski_length_m: float = SKI_LENGTH_M) -> dict[str, Place]:
    """The points of `LABELS` at one instant, those that there are."""
    known = {name: point for name, point in state.points.items() if point is not None}
    found = {
        name: Place(point.xyz, point.covariance, frozenset(point.cameras))
        for name, point in known.items()
        if name in POINTS
    }
    for side, binding in _BINDINGS.items():
        ski = state.skis.get(side)
        if ski is not None and binding in known:
            found |= _ends(side, known[binding], ski, ski_length_m / 2)
    origin = _origin(state, known)
    return found if origin is None else found | {"O": origin}


def _ends(side: str, binding: PointState, ski: SkiState, half: float) -> dict[str, Place]:
    """Tail and tip; the errors of binding and direction are taken as independent."""
    angles = np.radians([ski.slope.value, ski.heading.value])
    sigma = np.radians([ski.slope.sigma, ski.heading.sigma])
    up, aside = angles
    across = np.array((-math.sin(aside), math.cos(aside), 0.0)) * math.cos(up)
    upwards = direction_of(angles + np.array((math.pi / 2, 0.0)))
    by_angles = np.stack((upwards, across), axis=-1) * sigma
    turned = by_angles @ np.array(((1.0, ski.correlation), (ski.correlation, 1.0))) @ by_angles.T
    covariance = binding.covariance + half**2 * turned
    cameras = frozenset(binding.cameras) | frozenset(ski.cameras)
    return {
        f"{side}_{end}": Place(binding.xyz + sign * half * ski.direction, covariance, cameras)
        for end, sign in (("tail", -1.0), ("tip", 1.0))
    }


def _origin(state: JumperState, known: Mapping[str, PointState]) -> Place | None:
    """O. Of a raw one the sigma of Z is known; the correlation of P3 and P4 that it shows is taken for X and Y too."""
    if "P3" not in known or "P4" not in known or state.height is None:
        return None
    right, left = known["P3"], known["P4"]
    cameras = frozenset(right.cameras) | frozenset(left.cameras)
    if isinstance(state, SmoothedState):
        return Place(state.origin.value, state.origin.covariance, cameras)
    independent = (right.covariance + left.covariance) / 4
    correlated = state.height.sigma**2 / independent[2, 2]
    return Place((right.xyz + left.xyz) / 2, independent * correlated, cameras)
