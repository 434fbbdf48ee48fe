"""Names the tracks of a jump: P1 to P4 by where they are to each other, in all pulses together.

One track says little. What two tracks that are seen together are to each other, from the crouch to the flight, says
which is which. All namings are compared; a track whose name would change under another naming of nearly the same worth
stays unnamed.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from analysis.identification.body import REACH_M, FlightFrame, implausibility
from analysis.identification.tracks import Track
from analysis.measurements.model import POINTS
from rig.arrays import Floats

#: Implausibility at which two tracks are better left without names: chi-square, 4 degrees of freedom, 0.1 %.
_STRANGE = 18.5
#: Independent opinions about a pair of tracks at most: a body that is unusual in one pulse is so in all.
_OPINIONS = 4
_CALMS = 0.1  #: s after which a body's posture says something new
_BEAM = 200
_DECISIVE = 4.0
NAMELESS = len(POINTS)


def grouped(tracks: Sequence[Track]) -> list[list[Track]]:
    """Tracks that move together, by jump, in the order of time."""
    groups: list[list[Track]] = []
    for track in sorted(tracks, key=lambda t: -len(t)):
        home = next((group for group in groups if any(_together(track, other) for other in group)), None)
        if home is None:
            groups.append([track])
        else:
            home.append(track)
    return sorted(groups, key=lambda group: min(track.time_s[0] for track in group))


def _together(one: Track, other: Track) -> bool:
    """Whether two tracks may be parts of one body."""
    begin, end = max(one.time_s[0], other.time_s[0]), min(one.time_s[-1], other.time_s[-1])
    time = np.linspace(min(begin, end), max(begin, end), 5)
    gap = max(0.0, float(begin - end))
    if gap > 1.0:
        return False
    apart = np.linalg.norm(one.at(time) - other.at(time), axis=1)
    return bool(apart.min() < REACH_M)


def name_tracks(tracks: Sequence[Track], frame: FlightFrame, limit: int = 10) -> list[int]:
    """Index into `POINTS` of each track; `NAMELESS` where none fits or several do.

    Args:
        tracks: of one jump.
        frame: of the flight.
        limit: so many of the longest tracks are named.
    """
    order = sorted(range(len(tracks)), key=lambda i: -len(tracks[i]))[:limit]
    chosen = [tracks[i] for i in order]
    costs = _pair_costs(chosen, frame)
    beam: list[tuple[float, tuple[int, ...]]] = [(0.0, ())]
    for i in range(len(chosen)):
        longer = []
        for cost, names in beam:
            for name in range(NAMELESS + 1):
                more = sum(costs[j, i, names[j], name] for j in range(i))
                longer.append((cost + more, (*names, name)))
        beam = sorted(longer)[:_BEAM]
    best_cost, best = beam[0]
    result = [NAMELESS] * len(tracks)
    for i, track in enumerate(order):
        rivals = [cost for cost, names in beam if names[i] not in {best[i], NAMELESS}]
        if not rivals or min(rivals) - best_cost > _DECISIVE:
            result[track] = best[i]
    return result


def _opinions(time_s: Floats) -> float:
    return float(min(_OPINIONS, 1 + np.ptp(time_s) / _CALMS))


def _pair_costs(tracks: Sequence[Track], frame: FlightFrame) -> Floats:
    """Cost (n, n, names, names) of naming two tracks, 0 where one stays nameless.

    Plausible namings cost less than nothing; one name at two places at a time costs infinitely much.
    """
    n = len(tracks)
    costs = np.zeros((n, n, NAMELESS + 1, NAMELESS + 1))
    for i, j in combinations(range(n), 2):
        one, other = tracks[i], tracks[j]
        common = np.intersect1d(one.step, other.step)
        if len(common):
            at_one, at_other = np.isin(one.step, common), np.isin(other.step, common)
            difference = (other.xyz[at_other] - one.xyz[at_one]) @ frame.axes.T
            opinions = _opinions(one.time_s[at_one])
        else:
            begin = min(max(one.time_s[0], other.time_s[0]), max(one.time_s[-1], other.time_s[-1]))
            end = max(min(one.time_s[-1], other.time_s[-1]), min(one.time_s[0], other.time_s[0]))
            time = np.array([(begin + end) / 2])
            difference, opinions = (other.at(time) - one.at(time)) @ frame.axes.T, 1.0
        for a in range(NAMELESS):
            for b in range(NAMELESS):
                if a != b:
                    strange = np.minimum(implausibility(a, b, difference), 3 * _STRANGE).mean()
                    costs[i, j, a, b] = opinions * (strange - _STRANGE)
                elif len(common):
                    costs[i, j, a, b] = np.inf
                else:
                    costs[i, j, a, b] = _same(difference, one, other)
    return costs


def _same(difference: Floats, one: Track, other: Track) -> float:
    """Cost of two tracks at different times being one point: it must be near the other's continuation."""
    gap = max(other.time_s[0] - one.time_s[-1], one.time_s[0] - other.time_s[-1], 0.0)
    sigma = 0.05 + 4.0 * gap  # what a point moves off the mean velocity of the track, m and m/s
    return float((difference**2).sum(axis=1).mean() / sigma**2) - _STRANGE
