"""Gross errors in words and as JSON, in the frame of the network's file."""

from typing import Any

import numpy as np

from photogrammetry.adjustment.blunders import Blunder, BlunderKind, Observation
from photogrammetry.adjustment.state import Floats
from photogrammetry.network import ImageFrame, Network

_AXES = "XYZ"


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
            names["axis"] = _AXES[difference.axis]
    return names


def name_of(network: Network, observation: Observation) -> str:
    """The observation in words."""
    names = observation_to_json(network, observation)
    match observation.kind:
        case BlunderKind.IMAGE:
            return f"point {names['point']} in image {names['image']}"
        case BlunderKind.CONTROL:
            return f"control point {names['point']}"
        case BlunderKind.DISTANCE:
            return f"distance {names['from']} to {names['to']}"
        case _:
            return f"difference {names['axis']} from {names['from']} to {names['to']}"


def in_file_frame(network: Network, pairs: Floats) -> Floats:
    """Image vectors (..., 2) of the metric frame in the file's: y downwards in the pixel frame."""
    return pairs * np.array([1.0, -1.0]) if network.image_frame is ImageFrame.PIXEL else pairs


def estimate_in_file(network: Network, blunder: Blunder) -> list[float]:
    """The estimated error in the file's frame; nothing where nobody is accused."""
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
        "message": describe(network, blunder),
    }


def describe(network: Network, blunder: Blunder) -> str:
    """A gross error in words."""
    if len(blunder.candidates) == 1:
        name = name_of(network, blunder.suspect)
        return f"{name} is suspected (w = {abs(blunder.w):.1f}), but there is no result without it; measure it again"
    if not blunder.locatable:
        names = "; ".join(name_of(network, candidate) for candidate in blunder.candidates)
        return (
            f"one of these observations is wrong (w = {abs(blunder.w):.1f}), but the data cannot tell which: {names}; "
            "measure them again or add an observation"
        )
    image = blunder.suspect.kind is BlunderKind.IMAGE
    unit = ("px" if network.image_frame is ImageFrame.PIXEL else "image units") if image else network.length_unit
    size = ", ".join(f"{value:.3g}" for value in estimate_in_file(network, blunder))
    name = name_of(network, blunder.suspect)
    return f"{name}: wrong by about ({size}) {unit or 'length units'} (w = {abs(blunder.w):.1f}); measure it again"
