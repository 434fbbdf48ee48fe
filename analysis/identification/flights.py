"""Flights: tracks that move together, the path they share, and the frame along it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.identification.body import REACH_M
from analysis.identification.tracks import Track
from rig.arrays import Floats

#: A body that is hidden for longer than this is not the same one any more, s.
_MOST_HIDDEN_S = 1.0
_LEAST_BEND_S = 0.3  #: shorter flights are straight lines: their bend does not show


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """A body in flight.

    Attributes:
        begin_s: time of the first point of its tracks.
        end_s: of the last.
        middle_s: time at which `motion` is expanded.
        motion: (3, 3) place, velocity and acceleration there, m, s.
        axes: (3, 3) forward, left and up as rows: forward is horizontal along the flight, up is Z.
        tracks: of its points, and perhaps of others.
    """

    begin_s: float
    end_s: float
    middle_s: float
    motion: Floats
    axes: Floats
    tracks: tuple[Track, ...]

    def place(self, time_s: Floats) -> Floats:
        """Where the body is about, (n, 3)."""
        t = (time_s - self.middle_s)[:, None]
        return np.asarray(self.motion[0] + t * self.motion[1] + t**2 / 2 * self.motion[2])

    def velocity(self, time_s: Floats) -> Floats:
        """Its velocity (n, 3)."""
        return np.asarray(self.motion[1] + (time_s - self.middle_s)[:, None] * self.motion[2])


def find_flights(tracks: Sequence[Track]) -> list[Flight]:
    """The flights that tracks belong to, in the order of time.

    No two jumpers take off at the same time: what moves fast beside a flight with more support is a false track.
    """
    groups: list[list[Track]] = []
    for track in sorted(tracks, key=lambda t: -len(t)):
        home = next((group for group in groups if _together(group[0], track)), None)
        if home is None:
            groups.append([track])
        else:
            home.append(track)
    flights: list[Flight] = []
    for group in sorted(groups, key=lambda g: -sum(len(track) for track in g)):
        flight = _flight(group)
        if all(flight.begin_s > other.end_s or flight.end_s < other.begin_s for other in flights):
            flights.append(flight)
    return sorted(flights, key=lambda flight: flight.begin_s)


def _together(one: Track, other: Track) -> bool:
    """Whether two tracks may be parts of one body."""
    begin, end = max(one.time_s[0], other.time_s[0]), min(one.time_s[-1], other.time_s[-1])
    if begin - end > _MOST_HIDDEN_S:
        return False
    time = np.linspace(min(begin, end), max(begin, end), 5)
    return bool(np.linalg.norm(one.at(time) - other.at(time), axis=1).min() < REACH_M)


def _flight(tracks: Sequence[Track]) -> Flight:
    """The path of the longest track, with the velocity and acceleration that all share."""
    begin, end = min(t.time_s[0] for t in tracks), max(t.time_s[-1] for t in tracks)
    middle = (begin + end) / 2
    terms = 2 if end - begin > _LEAST_BEND_S else 1
    rows, values = [], []
    for i, track in enumerate(tracks):
        t = track.time_s - middle
        rows.append(np.column_stack((np.eye(len(tracks))[[i] * len(t)], t, t**2 / 2))[:, : len(tracks) + terms])
        values.append(track.xyz)
    solved = np.linalg.lstsq(np.concatenate(rows), np.concatenate(values), rcond=None)[0]
    motion = np.zeros((3, 3))
    motion[0], motion[1 : 1 + terms] = solved[0], solved[len(tracks) :]
    forward = np.array((motion[1, 0], motion[1, 1], 0.0)) / np.hypot(motion[1, 0], motion[1, 1])
    up = np.array((0.0, 0.0, 1.0))
    axes = np.stack((forward, np.cross(up, forward), up))
    return Flight(float(begin), float(end), float(middle), motion, axes, tuple(tracks))
