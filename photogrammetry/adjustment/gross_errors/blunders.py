"""What a gross error is, a network without the observation concerned, and how it is named, in words and as JSON."""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Final

import numpy as np

from photogrammetry.network.model import AXES, ImageFrame, Network, Role
from photogrammetry.network.selection import only_observations
from rig.arrays import Floats
from rig.phrase import Phrase, phrase
from rig.phrases import in_turn


class BlunderKind(StrEnum):
    """Kinds of observations that are tested."""

    IMAGE = "image"
    CONTROL = "control"
    DISTANCE = "distance"
    DIFFERENCE = "difference"


@dataclass(frozen=True, slots=True)
class Observation:
    """One observation: index of the image observation, control point, distance or difference in the network."""

    kind: BlunderKind
    index: int


LARGE_W: Final = 3.29  #: |w| that one of 1000 sound observations exceeds


@dataclass(frozen=True, slots=True, eq=False)
class Blunder:
    """A suspected gross error.

    Attributes:
        suspect: the observation with the largest test value.
        estimate: observed - true, one number per coordinate, metric frame, in the observation's unit.
        w: test value; that of the worse coordinate of an image point.
        locatable: whether the data show that it is this observation and no other.
        candidates: the observations any of which may be the wrong one, the suspect first; empty if it is locatable.
    """

    suspect: Observation
    estimate: Floats
    w: float
    locatable: bool
    candidates: tuple[Observation, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Removed:
    """An observation that was taken out.

    Attributes:
        blunder: its gross error.
        network: the network that the indices in `blunder` belong to (they change when an observation is taken out).
    """

    blunder: Blunder
    network: Network


def without(network: Network, observation: Observation) -> Network:
    """The network without one observation; a control point becomes a check point."""
    i = observation.index
    match observation.kind:
        case BlunderKind.IMAGE:
            return only_observations(network, np.arange(len(network.observations.image)) != i)
        case BlunderKind.CONTROL:
            point = replace(network.points[i], role=Role.CHECK, sigma=None)
            return replace(network, points=(*network.points[:i], point, *network.points[i + 1 :]))
        case BlunderKind.DISTANCE:
            return replace(network, distances=network.distances[:i] + network.distances[i + 1 :])
        case _:
            return replace(network, differences=network.differences[:i] + network.differences[i + 1 :])


def index_without(observation: Observation, gone: Observation) -> Observation:
    """The same observation with the index that it has once `gone` is taken out."""
    shifts = observation.kind is gone.kind and gone.kind is not BlunderKind.CONTROL
    return (
        replace(observation, index=observation.index - 1) if shifts and observation.index > gone.index else observation
    )


def observation_to_json(network: Network, observation: Observation) -> dict[str, Any]:
    """The names of an observation: kind, image and point, or the two ends."""
    names: dict[str, Any] = {"kind": observation.kind.value, "image": None, "point": None}
    match observation.kind:
        case BlunderKind.IMAGE:
            o = network.observations
            names["image"] = network.images[o.image[observation.index]].name
            names["point"] = network.points[o.point[observation.index]].name
        case BlunderKind.CONTROL:
            names["point"] = network.points[observation.index].name
        case BlunderKind.DISTANCE:
            distance = network.distances[observation.index]
            names |= {"from": network.points[distance.start].name, "to": network.points[distance.end].name}
        case _:
            difference = network.differences[observation.index]
            names |= {"from": network.points[difference.start].name, "to": network.points[difference.end].name}
            names["axis"] = AXES[difference.axis]
    return names


def name_of(network: Network, observation: Observation) -> Phrase:
    """The observation in words."""
    names = observation_to_json(network, observation)
    match observation.kind:
        case BlunderKind.IMAGE:
            text = "point {point} in image {image}"
            return phrase("observed_image", text, point=names["point"], image=names["image"])
        case BlunderKind.CONTROL:
            return phrase("observed_control", "control point {point}", point=names["point"])
        case BlunderKind.DISTANCE:
            text = "distance {start} to {end}"
            return phrase("observed_distance", text, start=names["from"], end=names["to"])
        case _:
            text = "difference {axis} from {start} to {end}"
            return phrase("observed_difference", text, axis=names["axis"], start=names["from"], end=names["to"])


def in_file_frame(network: Network, pairs: Floats) -> Floats:
    """Image vectors (..., 2) of the metric frame in the file's: y downwards in the pixel frame."""
    return pairs * np.array([1.0, -1.0]) if network.image_frame is ImageFrame.PIXEL else pairs


def estimate_in_file(network: Network, blunder: Blunder) -> list[float]:
    """The estimated error in the file's frame; empty if the blunder is not locatable."""
    if not blunder.locatable:
        return []
    if blunder.suspect.kind is BlunderKind.IMAGE:
        return [float(value) for value in in_file_frame(network, blunder.estimate)]
    return [float(value) for value in blunder.estimate]


def blunder_to_json(network: Network, blunder: Blunder) -> dict[str, Any]:
    """One entry of `gross_errors`."""
    names = observation_to_json(network, blunder.suspect)
    if not blunder.locatable:
        names = {key: value if key == "kind" else None for key, value in names.items()}
    return {
        **names,
        "estimate": estimate_in_file(network, blunder),
        "w": blunder.w,
        "locatable": blunder.locatable,
        "candidates": [observation_to_json(network, candidate) for candidate in blunder.candidates],
        "message": describe(network, blunder).text,
    }


def describe(network: Network, blunder: Blunder) -> Phrase:
    """A gross error in words."""
    name, w = name_of(network, blunder.suspect), _test_value(blunder)
    if len(blunder.candidates) == 1:
        text = "{what} is suspected{w}, but there is no result without it; measure it again"
        return phrase("blunder_needed", text, what=name, w=w)
    if not blunder.locatable:
        text = (
            "one of these observations is wrong{w}, but the data cannot tell which: {which}; measure them again or add "
            "an observation"
        )
        which = in_turn([name_of(network, candidate) for candidate in blunder.candidates])
        return phrase("blunder_one_of", text, which=which, w=w)
    image = blunder.suspect.kind is BlunderKind.IMAGE
    unit = network.image_unit if image else network.length_unit
    size = ", ".join(f"{value:.3g}" for value in estimate_in_file(network, blunder))
    text = "{what}: wrong by about ({size}) {unit}{w}; measure it again"
    return phrase("blunder_sized", text, what=name, size=size, unit=unit or "length units", w=w)


def _test_value(blunder: Blunder) -> str:
    """The test value in brackets, if it is large.

    It is scaled by the estimated sigma0. With few redundant observations the gross error itself makes sigma0 large:
    then it is found by the a-priori sigmas, and a small test value would only seem to deny it.
    """
    return f" (w = {abs(blunder.w):.1f})" if abs(blunder.w) >= LARGE_W else ""
