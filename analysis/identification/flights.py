"""Flights: what moves like a jumper from pulse to pulse, the path that its points share, and the frame along it.

A jumper is the only thing on a hill that moves with his speed on a nearly straight path. Snow, officials, flags and
wrong correspondences do not. So the tracks of points are found without knowing which point is which marker, and those
that move together are a flight.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from analysis.identification.body import REACH_M
from analysis.identification.space_points import SpacePoints
from rig.arrays import Floats, Integers

#: Speeds of a jumper on the table and in the early flight, m/s, with what his limbs may add.
SPEEDS_M_S = (12.0, 42.0)
#: Standard deviation of the acceleration of a point of the body, m/s^2: a take-off moves the hip by some 15 m/s^2.
ACCELERATION_M_S2 = 15.0
_STEEPEST = np.sin(np.radians(50.0))  #: of a path, down or up
_LEAST_POINTS = 4  #: of a track; three fix place, velocity and one check
_MOST_MISSED_S = 0.12  #: in a track, between one point and the next
_FITS = float(chi2.ppf(0.999, 3))
_MOST_USES = 2  #: of a spot, by points of tracks
_WEAK = 0.5  #: weight of a point that two rays show and nothing controls
#: A body that is hidden for longer than this is not the same one any more, s.
_MOST_HIDDEN_S = 1.0
_LEAST_BEND_S = 0.3  #: shorter flights are straight lines: their bend does not show


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A moving point.

    Attributes:
        step: (k,) index of the pulse.
        rays: (k, m) spots that show it, by camera; -1: none.
        time_s: (k,) of the pulse.
        xyz: (k, 3) m.
        covariance: (k, 3, 3) m^2.
    """

    step: Integers
    rays: Integers
    time_s: Floats
    xyz: Floats
    covariance: Floats

    def __len__(self) -> int:
        return len(self.step)

    def velocity(self) -> Floats:
        """Mean velocity (3,), m/s."""
        return np.asarray(np.polyfit(self.time_s - self.time_s.mean(), self.xyz, 1)[0])

    def at(self, time_s: Floats) -> Floats:
        """Places (n, 3) at times (n,): between points interpolated, beyond them with the mean velocity."""
        inside = np.clip(time_s, self.time_s[0], self.time_s[-1])
        places = np.stack([np.interp(inside, self.time_s, self.xyz[:, i]) for i in range(3)], axis=-1)
        return np.asarray(places + (time_s - inside)[:, None] * self.velocity())


def find_tracks(points: Sequence[SpacePoints], time_s: Floats) -> list[Track]:
    """Tracks, those with the most support first; no point belongs to two.

    Args:
        points: of each pulse.
        time_s: of each pulse.
    """
    points = [_thinned(of_pulse) for of_pulse in points]
    links = _Links(points, time_s)
    tracks = []
    while (chain := links.best_chain()) is not None:
        step = np.array([s for s, _ in chain])
        rays = np.array([points[s].rays[p] for s, p in chain])
        xyz = np.array([points[s].xyz[p] for s, p in chain])
        covariance = np.array([points[s].covariance[p] for s, p in chain])
        tracks.append(Track(step, rays, time_s[step], xyz, covariance))
    return tracks


def _thinned(points: SpacePoints) -> SpacePoints:
    """The points of a pulse without those whose spots better points share: more rays, then a smaller misfit."""
    order = np.lexsort((points.misfit, -points.count))
    uses: dict[tuple[int, int], int] = {}
    kept = []
    for i in order.tolist():
        spots = [(k, s) for k, s in enumerate(points.rays[i].tolist()) if s >= 0]
        if all(uses.get(spot, 0) < _MOST_USES for spot in spots):
            kept.append(i)
            uses.update({spot: uses.get(spot, 0) + 1 for spot in spots})
    return SpacePoints(points.xyz[kept], points.covariance[kept], points.rays[kept], points.misfit[kept])


class _Links:
    """Steps from a point to one of a later pulse, and which step may follow which."""

    def __init__(self, points: Sequence[SpacePoints], time_s: Floats) -> None:
        self._weight = [np.where(p.count > 2, 1.0, _WEAK) for p in points]
        self._ends: list[tuple[tuple[int, int], tuple[int, int]]] = []
        self._before: list[list[tuple[int, float]]] = []
        self._used: set[tuple[int, int]] = set()
        arriving: dict[tuple[int, int], list[int]] = {}
        for b in range(1, len(points)):
            first = int(np.searchsorted(time_s, time_s[b] - _MOST_MISSED_S))
            for a in range(min(first, b - 1), b):
                self._link(points, time_s, a, b, arriving)

    def _link(
        self,
        points: Sequence[SpacePoints],
        time_s: Floats,
        a: int,
        b: int,
        arriving: dict[tuple[int, int], list[int]],
    ) -> None:
        """Add the steps from pulse a to pulse b."""
        if not len(points[a]) or not len(points[b]):
            return
        dt = float(time_s[b] - time_s[a])
        way = points[b].xyz[None] - points[a].xyz[:, None]
        distance = np.maximum(np.linalg.norm(way, axis=2), 1e-9)
        blur = points[b].covariance[None] + points[a].covariance[:, None]
        spread = 3 * np.sqrt(np.einsum("abi,abij,abj->ab", way, blur, way)) / distance
        fast = (distance + spread > SPEEDS_M_S[0] * dt) & (distance - spread < SPEEDS_M_S[1] * dt)
        level = np.abs(way[..., 2]) < _STEEPEST * distance + spread
        for i, j in np.argwhere(fast & level):
            before = self._predecessors(points, time_s, (a, int(i)), (b, int(j)), arriving)
            arriving.setdefault((b, int(j)), []).append(len(self._ends))
            self._ends.append(((a, int(i)), (b, int(j))))
            self._before.append(before)

    def _predecessors(
        self,
        points: Sequence[SpacePoints],
        time_s: Floats,
        middle: tuple[int, int],
        end: tuple[int, int],
        arriving: dict[tuple[int, int], list[int]],
    ) -> list[tuple[int, float]]:
        """Steps that arrive at `middle` with the velocity that leads on to `end`, and their misfits."""
        steps = arriving.get(middle, [])
        if not steps:
            return []
        starts = [self._ends[step][0] for step in steps]
        dt = time_s[end[0]] - time_s[middle[0]]
        back = time_s[middle[0]] - time_s[[s for s, _ in starts]]
        ratio = dt / back
        here, there = points[middle[0]], points[end[0]]
        came = here.xyz[middle[1]] - np.array([points[s].xyz[p] for s, p in starts])
        off = there.xyz[end[1]] - here.xyz[middle[1]] - ratio[:, None] * came
        bend = ACCELERATION_M_S2 * dt * (dt + back) / 2
        covariance = (
            there.covariance[end[1]]
            + ((1 + ratio) ** 2)[:, None, None] * here.covariance[middle[1]]
            + (ratio**2)[:, None, None] * np.array([points[s].covariance[p] for s, p in starts])
            + (bend**2)[:, None, None] * np.eye(3)
        )
        misfit = np.einsum("ni,ni->n", off, np.linalg.solve(covariance, off[..., None])[..., 0])
        return [(step, float(value)) for step, value in zip(steps, misfit, strict=True) if value < _FITS]

    def best_chain(self) -> list[tuple[int, int]] | None:
        """The chain with the greatest weight less misfit; its points are taken out. None: no chain is long enough."""
        n = len(self._ends)
        score, came, length = np.full(n, -np.inf), np.full(n, -1), np.zeros(n, int)
        for link, (start, end) in enumerate(self._ends):
            if start in self._used or end in self._used:
                continue
            gain = self._weight[end[0]][end[1]]
            score[link], length[link] = self._weight[start[0]][start[1]] + gain, 2
            for before, misfit in self._before[link]:
                value = score[before] + gain * (1 - misfit / (2 * _FITS))
                if value > score[link]:
                    score[link], came[link], length[link] = value, before, length[before] + 1
        score[length < _LEAST_POINTS] = -np.inf
        if not n or not np.isfinite(score.max()):
            return None
        link = int(score.argmax())
        chain = [self._ends[link][1]]
        while link >= 0:
            chain.append(self._ends[link][0])
            link = int(came[link])
        self._used.update(chain)
        return chain[::-1]


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
