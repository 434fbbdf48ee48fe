"""The markers of one jump: from the tracks that have names to a spot for each marker in every image that shows it.

Prediction and assignment take turns: what is assigned at other pulses predicts where a marker is at this one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.identification.assignment import Assigned, assign
from analysis.identification.body import FlightFrame
from analysis.identification.prediction import MARKER, Prediction, predict
from analysis.identification.skis import Places
from analysis.identification.space_points import Rays, SpacePoints
from analysis.identification.views import Views
from analysis.measurements.model import POINTS
from rig.arrays import Flags, Floats

#: Indices of P3 and P4 in `POINTS`.
BINDINGS = (2, 3)
_MOST_TURNS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Markers:
    """The markers of a jump at t pulses.

    Attributes:
        assigned: their spots.
        predicted: their places by the other pulses.
    """

    assigned: Assigned
    predicted: Prediction

    def places(self, markers: Sequence[int]) -> Places:
        """Places of some markers by all pulses, this one too."""
        which = list(markers)
        inverse = np.linalg.inv(self.predicted.covariance[:, which])
        right = inverse @ self.predicted.xyz[:, which, :, None]
        seen = np.asarray(np.isfinite(self.assigned.xyz[:, which]).all(axis=2))
        measured = np.linalg.inv(np.where(seen[..., None, None], self.assigned.covariance[:, which], np.eye(3)))
        measured[~seen] = 0.0
        right += measured @ np.nan_to_num(self.assigned.xyz[:, which])[..., None]
        covariance = np.asarray(np.linalg.inv(inverse + measured), float)
        return Places((covariance @ right)[..., 0], covariance)


def follow_markers(
    views: Views,
    time_s: Floats,
    pulses: Sequence[Sequence[Rays]],
    delivered: Flags,
    points: Sequence[SpacePoints],
    frame: FlightFrame,
    start: Mapping[tuple[int, int], tuple[Floats, Floats]],
) -> Markers:
    """Find the spots of all markers.

    Args:
        views: the cameras.
        time_s: (t,) of the pulses.
        pulses: spots of each pulse by camera.
        delivered: (t, m) whether a camera has an image of a pulse.
        points: in space, of each pulse.
        frame: of the flight.
        start: place and covariance by pulse and marker, from the tracks.
    """
    xyz = np.full((len(time_s), len(POINTS), 3), np.nan)
    covariance = np.full((len(time_s), len(POINTS), 3, 3), np.nan)
    for (step, marker), (place, accuracy) in start.items():
        xyz[step, marker], covariance[step, marker] = place, accuracy
    rays = np.full((len(time_s), len(POINTS), len(views)), -2)
    for _ in range(_MOST_TURNS):
        predicted = predict(time_s, xyz, covariance, frame.velocity, MARKER)
        assigned = assign(views, pulses, delivered, points, predicted)
        if (assigned.rays == rays).all():
            break
        rays, xyz, covariance = assigned.rays, assigned.xyz, assigned.covariance
    return Markers(assigned, predicted)
