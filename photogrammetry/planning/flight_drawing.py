"""A planned flight in the drawings of its network: the stick model at some positions, with its error ellipses."""

import numpy as np
from numpy.typing import NDArray

from photogrammetry.adjustment.adjustment import Adjustment
from photogrammetry.planning.plan import Flight, Plan
from photogrammetry.planning.prediction import carry
from photogrammetry.protocol.network_drawings import Extras, Place, Track
from photogrammetry.protocol.svg import Colour

_EVERY = 4  # positions: more cover each other


def flight_extras(plan: Plan, flight: Flight, adjusted: Adjustment) -> Extras:
    """Paths of all points; points, body and skis at every fourth position."""
    covariance = carry(plan, flight, adjusted).covariance
    shown = range(0, len(flight.points), _EVERY)
    places = [
        Place(
            "",
            flight.points[t, p],
            covariance[t, 3 * p : 3 * p + 3, 3 * p : 3 * p + 3],
            Colour.AMBER,
        )
        for t in shown
        for p in range(len(flight.names))
    ]
    tracks = [Track(flight.points[:, p], Colour.FAINT) for p in range(len(flight.names))]
    tracks += [Track(flight.skis[t, s], Colour.AMBER, 1.4) for t in shown for s in range(len(flight.ski_names))]
    tracks += [Track(_body(flight, t), Colour.AMBER, 1.4) for t in shown if flight.stick is not None]
    tied = frozenset(int(point) for point in flight.tie[flight.tie >= 0])
    words = f" and jumper (amber) at every {_EVERY}th of {len(flight.points)} positions,"
    return Extras(tuple(places), tuple(tracks), words, tied)


def _body(flight: Flight, position: int) -> NDArray[np.float64]:
    """Helmet, hip, O."""
    points, stick = flight.points[position], flight.stick
    if stick is None:
        raise ValueError("a flight without a stick model has no body")
    return np.stack((points[stick.helmet], points[stick.hip], points[list(stick.bindings)].mean(axis=0)))
