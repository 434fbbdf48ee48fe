"""Names points in space: P1 to P4 by what they are to each other in a pulse, and as one path over all pulses.

In each pulse the best namings of the points near the flight's path compete: their rays must not share a spot, and they
must look like a body. The path through all pulses then takes one naming of each, so that the names move as a body does.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from analysis.identification.over_time.assignment import DECISIVE, DETECTED
from analysis.identification.over_time.flights import Flight
from analysis.identification.over_time.window import Window
from analysis.identification.space.body import REACH_M, implausibility
from analysis.identification.space.sides import shown
from analysis.identification.space.space_points import Rays, SpacePoints
from analysis.identification.space.views import Views
from analysis.measurements.model import POINTS
from rig.arrays import Flags, Floats, Integers

_ORDER = (2, 3, 1, 0)  #: bindings, hip, helmet: each restricts the next
_MOST_POINTS = 24  #: of a pulse
_BEAM = 60
_MOST_NAMINGS = 30  #: of a pulse
_BODY_M = 0.5  #: standard deviation of a point of the body from its middle
_LIMBS_M_S = 4.0  #: standard deviation of the velocity of a point of the body against the body's
_FAR = 1e6  #: cost of what cannot be


@dataclass(frozen=True, slots=True, eq=False)
class Namings:
    """Possible namings of the points of one pulse, the best first.

    Attributes:
        points: (h, 4) index of the point in space for each of `POINTS`; -1: none.
        costs: (h,) as in `assignment`.
    """

    points: Integers
    costs: Floats


def name_points(views: Views, window: Window, flight: Flight) -> Integers:
    """Points (t, 4) of the body: index of the point in space of each pulse; -1: none.

    Args:
        views: the cameras.
        window: the pulses.
        flight: near whose path the points are sought.
    """
    time_s, points = window.time_s, window.points
    path, velocity = flight.place(time_s), flight.velocity(time_s)
    namings = [
        _namings(
            points[t], _worths(views, window.rays[t], window.delivered[t], points[t], of_sides), path[t], flight.axes
        )
        for t, of_sides in enumerate(shown(views, path[:, None], flight.axes[1]))
    ]
    costs = [namings[0].costs]
    came = []
    for t in range(1, len(time_s)):
        dt = float(time_s[t] - time_s[t - 1])
        steps = _steps(points[t - 1], points[t], velocity[t] * dt, _LIMBS_M_S * dt)
        one, other = namings[t - 1].points, namings[t].points
        total = costs[-1][:, None] + steps[one[:, None], other[None]].sum(axis=2)
        came.append(total.argmin(axis=0))
        costs.append(total.min(axis=0) + namings[t].costs)
    best = int(costs[-1].argmin())
    path_back = [best]
    for back in reversed(came):
        path_back.append(int(back[path_back[-1]]))
    return np.array([naming.points[h] for naming, h in zip(namings, path_back[::-1], strict=True)])


def _worths(views: Views, rays: Sequence[Rays], delivered: Flags, points: SpacePoints, of_sides: Floats) -> Floats:
    """Cost (4, n) of each point being each marker against chance; of_sides (4, m), see `shown`."""
    sizes = np.array([float(np.prod(placed.size)) for placed in views.placed])
    rate = 2 * np.log(2 * np.pi / (DETECTED * of_sides) * (1 + np.array([len(r.xy) for r in rays])) / sizes)
    rate = rate + np.where(delivered, 2 * np.log(1 - DETECTED), 0.0)
    cost = points.misfit + np.linalg.slogdet(points.covariance + _BODY_M**2 * np.eye(3))[1]
    cost = np.tile(cost - np.linalg.slogdet(points.covariance)[1], (len(POINTS), 1))
    for k, of_camera in enumerate(rays):
        seen = points.rays[:, k] >= 0
        spots = points.rays[seen, k]
        cost[:, seen] += rate[:, k, None] + 2 * np.log(of_camera.variance[spots]) + of_camera.odd[spots]
    return np.asarray(cost)


def _namings(points: SpacePoints, worths: Floats, path: Floats, axes: Floats) -> Namings:
    """The best namings of one pulse."""
    best = worths.min(axis=0)
    near = np.flatnonzero((np.linalg.norm(points.xyz - path, axis=1) < REACH_M) & (best < -DECISIVE))
    near = near[np.argsort(best[near])][:_MOST_POINTS]
    n = len(near)
    local = points.xyz[near] @ axes.T
    apart = (local[None] - local[:, None]).reshape(-1, 3)
    rays = points.rays[near]
    shared = ((rays[None] == rays[:, None]) & (rays[None] >= 0)).any(axis=2)
    pair = np.zeros((len(POINTS), len(POINTS), n + 1, n + 1))  # the last row and column stand for no point
    for a, b in permutations(range(len(POINTS)), 2):
        pair[a, b, :n, :n] = implausibility(a, b, apart).reshape(n, n) + _FAR * shared
    worth = np.column_stack((worths[:, near], np.zeros(len(POINTS))))
    chosen, costs = np.full((1, len(POINTS)), n), np.zeros(1)
    for name in _ORDER:
        total = costs[:, None] + worth[name]
        for other in range(len(POINTS)):
            total = total + pair[other, name][chosen[:, other]]
        best = np.argsort(total, axis=None)[:_BEAM]
        row, column = np.unravel_index(best, total.shape)
        chosen = chosen[row]
        chosen[:, name] = column
        costs = total[row, column]
    chosen, costs = chosen[:_MOST_NAMINGS], costs[:_MOST_NAMINGS]
    if not (chosen == n).all(axis=1).any():
        chosen, costs = np.append(chosen, np.full((1, len(POINTS)), n), axis=0), np.append(costs, 0.0)
    return Namings(np.append(near, -1)[chosen], costs)


def _steps(one: SpacePoints, other: SpacePoints, way: Floats, limbs: float) -> Floats:
    """Chi-square (n + 1, m + 1) of points of one pulse being at those of the next; 0 where one is none (index -1)."""
    steps = np.zeros((len(one) + 1, len(other) + 1))
    off = other.xyz[None] - one.xyz[:, None] - way
    total = one.covariance[:, None] + other.covariance[None] + limbs**2 * np.eye(3)
    steps[:-1, :-1] = np.einsum("abi,abi->ab", off, np.linalg.solve(total, off[..., None])[..., 0])
    return steps
