"""Flights: what moves like a jumper from pulse to pulse, the path that its points share, and the frame along it.

A jumper is the only thing on a hill that moves with his speed on a nearly straight path. Snow, officials, flags and
wrong correspondences do not. So the tracks of points are found without knowing which point is which marker, and those
that move together are a flight.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from analysis.identification.space.body import REACH_M
from analysis.identification.space.space_points import SpacePoints
from rig.arrays import Floats, Integers

#: Speeds of a jumper on the table and in the early flight, m/s, with what his limbs may add.
SPEEDS_M_S = (12.0, 42.0)
#: Standard deviation of the acceleration of a point of the body, m/s^2: a take-off moves the hip by some 15 m/s^2.
ACCELERATION_M_S2 = 15.0
_STEEPEST = np.sin(np.radians(50.0))  #: of a path, down or up
_LEAST_POINTS = 4  #: of a track; three fix place, velocity and one check
_MOST_MISSED_S = 0.12  #: in a track, between one point and the next
_FITS = float(chdtri(3, 0.001))
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


@dataclass(frozen=True, slots=True, eq=False)
class _Arrivals:
    """Steps that arrive at the points of one pulse, by point.

    Attributes:
        link: (n,) number of the step.
        at: (n,) the point at which it arrives, ascending.
        back_s: (n,) time that it took.
        xyz: (n, 3) where it came from, with covariance (n, 3, 3).
        covariance: see `xyz`.
    """

    link: Integers
    at: Integers
    back_s: Floats
    xyz: Floats
    covariance: Floats

    @classmethod
    def joined(cls, parts: Sequence["_Arrivals"]) -> "_Arrivals":
        """The steps of several earlier pulses."""
        at = np.concatenate([part.at for part in parts])
        order = np.argsort(at, kind="stable")
        return cls(*(np.concatenate([getattr(part, name) for part in parts])[order] for name in cls.__slots__))

    def of(self, points: Integers) -> tuple[Integers, Integers]:
        """Of n points of the pulse the pairs of index (below n) and arrival."""
        first, last = np.searchsorted(self.at, points), np.searchsorted(self.at, points, side="right")
        which = np.repeat(np.arange(len(points)), last - first)
        return which, np.arange(len(which)) - np.repeat(np.cumsum(last - first) - last, last - first)


@dataclass(frozen=True, slots=True, eq=False)
class _Following:
    """Which of k steps may follow which earlier ones: n pairs, by step.

    Attributes:
        before: (n,) number of the earlier step.
        gain: (n,) what a chain gains by the later one.
        step: (k,) number of the later one, ascending.
        first: (k,) its first pair.
        count: (k,) of its pairs.
    """

    before: Integers
    gain: Floats
    step: Integers
    first: Integers
    count: Integers

    @classmethod
    def of(cls, step: Integers, before: Integers, gain: Floats) -> "_Following":
        """Pairs (n,) of steps, ascending, and earlier ones."""
        return cls(before, gain, *np.unique(step, return_index=True, return_counts=True))

    def best(self, score: Floats) -> tuple[Integers, Floats]:
        """For each step the best earlier one, and the score with it."""
        value = score[self.before] + self.gain
        best = np.maximum.reduceat(value, self.first)
        hit = np.flatnonzero(value == np.repeat(best, self.count))
        return self.before[hit[np.searchsorted(hit, self.first)]], best


class _Links:
    """Steps from a point to one of a later pulse, and which step may follow which."""

    def __init__(self, points: Sequence[SpacePoints], time_s: Floats) -> None:
        weights = [np.where(p.count > 2, 1.0, _WEAK) for p in points]
        numbers = np.cumsum([0, *(len(weight) for weight in weights)])
        self._step = np.repeat(np.arange(len(weights)), np.diff(numbers))  # of each point of all pulses
        self._first = numbers[self._step]
        self._weight = np.concatenate(weights) if weights else np.empty(0)
        self._used = np.zeros(len(self._weight), bool)
        self._count = 0
        self._following: list[_Following] = []
        starts: list[Integers] = []
        ends: list[Integers] = []
        arriving: list[_Arrivals | None] = [None]
        for b in range(1, len(points)):
            found, new = int(np.searchsorted(time_s, time_s[b] - _MOST_MISSED_S)), []
            for a in range(min(found, b - 1), b):
                if len(points[a]) and len(points[b]):
                    i, j = _steps(points[a], points[b], dt := float(time_s[b] - time_s[a]))
                    new.append(self._added(points[a], points[b], i, j, dt, weights[b], arriving[a]))
                    starts.append(numbers[a] + i)
                    ends.append(numbers[b] + j)
            arriving.append(_Arrivals.joined(new) if new else None)
        self._ends = np.stack([np.concatenate(of) if of else np.empty(0, int) for of in (starts, ends)])

    def _added(
        self,
        here: SpacePoints,
        there: SpacePoints,
        i: Integers,
        j: Integers,
        dt: float,
        weight: Floats,
        arrivals: _Arrivals | None,
    ) -> _Arrivals:
        """Add steps from points i (n,) of one pulse to points j (n,) of another, dt later."""
        number = self._count + np.arange(len(i))
        self._count += len(i)
        if arrivals is not None:
            step, came, misfit = _following(here, there, i, j, dt, arrivals)
            gain = weight[j[step]] * (1 - misfit / (2 * _FITS))
            if len(step):
                self._following.append(_Following.of(number[step], arrivals.link[came], gain))
        return _Arrivals(number, j, np.full(len(i), dt), here.xyz[i], here.covariance[i])

    def best_chain(self) -> list[tuple[int, int]] | None:
        """The chain with the greatest weight less misfit; its points are taken out. None: no chain is long enough."""
        start, end = self._ends
        gone = self._used[start] | self._used[end]
        score = np.where(gone, -np.inf, self._weight[start] + self._weight[end])
        came, length = np.full(len(score), -1), np.full(len(score), 2)
        for following in self._following:
            step, (before, value) = following.step, following.best(score)
            better = (value > score[step]) & ~gone[step]
            step, before = step[better], before[better]
            score[step], came[step], length[step] = value[better], before, length[before] + 1
        score[length < _LEAST_POINTS] = -np.inf
        if not len(score) or not np.isfinite(score.max()):
            return None
        link = int(score.argmax())
        chain = [int(end[link])]
        while link >= 0:
            chain.append(int(start[link]))
            link = int(came[link])
        self._used[chain] = True
        return [(int(self._step[p]), int(p - self._first[p])) for p in reversed(chain)]


def _steps(here: SpacePoints, there: SpacePoints, dt: float) -> tuple[Integers, Integers]:
    """Pairs of points of two pulses, dt apart, between which a jumper may have moved."""
    way = there.xyz[None] - here.xyz[:, None]
    distance = np.maximum(np.linalg.norm(way, axis=2), 1e-9)
    blur = there.covariance[None] + here.covariance[:, None]
    spread = 3 * np.sqrt(np.einsum("abi,abij,abj->ab", way, blur, way)) / distance
    fast = (distance + spread > SPEEDS_M_S[0] * dt) & (distance - spread < SPEEDS_M_S[1] * dt)
    level = np.abs(way[..., 2]) < _STEEPEST * distance + spread
    i, j = np.nonzero(fast & level)
    return i, j


def _following(
    here: SpacePoints, there: SpacePoints, i: Integers, j: Integers, dt: float, arrivals: _Arrivals
) -> tuple[Integers, Integers, Floats]:
    """Which steps may follow which: index of a step from point i to point j, that of an arrival, and their misfit."""
    step, came = arrivals.of(i)
    ratio = dt / arrivals.back_s[came]
    bend = (ACCELERATION_M_S2 * dt * (dt + arrivals.back_s[came]) / 2) ** 2
    off = there.xyz[j[step]] - here.xyz[i[step]]
    off -= ratio[:, None] * (here.xyz[i[step]] - arrivals.xyz[came])
    traces = [np.trace(of, axis1=1, axis2=2) for of in (there.covariance, here.covariance, arrivals.covariance)]
    most = traces[0][j[step]] + (1 + ratio) ** 2 * traces[1][i[step]] + ratio**2 * traces[2][came] + 3 * bend
    # no variance is larger than the trace: by this bound most pairs are refused already
    near = np.flatnonzero((off**2).sum(axis=1) < _FITS * most)
    step, came, off, ratio, bend = step[near], came[near], off[near], ratio[near, None, None], bend[near, None, None]
    covariance = (
        there.covariance[j[step]]
        + (1 + ratio) ** 2 * here.covariance[i[step]]
        + ratio**2 * arrivals.covariance[came]
        + bend * np.eye(3)
    )
    misfit = np.einsum("ni,ni->n", off, np.linalg.solve(covariance, off[..., None])[..., 0])
    fits = misfit < _FITS
    return step[fits], came[fits], misfit[fits]


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
