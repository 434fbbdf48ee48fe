"""Assigns the spots of each pulse to the predicted markers: jointly optimal over all markers and all images.

Every option of a marker (a point in space with its rays, a single ray, nothing) has the same currency: minus twice the
logarithm of its probability density against that of chance, which puts spots anywhere in an image. So an option with
three rays competes fairly with one of two, and a spot counts more where few others are.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np

from analysis.identification.body import USUAL, implausibility
from analysis.identification.prediction import Prediction
from analysis.identification.space_points import Rays, SpacePoints, squared_distances
from analysis.identification.views import Sight, Views, gate
from analysis.identification.window import Window
from rig.arrays import Flags, Floats, Integers

#: How much likelier than each rival, and than chance, an assignment must be: minus twice the logarithm of 1/1000.
DECISIVE = 13.8
DETECTED = 0.9  #: share of the markers in an image that are found as spots
Strangeness: TypeAlias = dict[tuple[int, int, int, int], float]

_LITTLE = 0.03  #: change of a prediction, in its standard deviations, that changes no assignment
MOST_OPTIONS = 5  #: of a marker
MOST_VAGUE_M = 0.35  #: standard deviation of a prediction that is still of use: less than from binding to binding


@dataclass(frozen=True, slots=True, eq=False)
class Option:
    """What may be a marker (or a ski).

    Attributes:
        cost: see the module.
        rays: (m,) index of the spot in each image; -1: none.
        point: index of what the rays make in space; -1: nothing.
    """

    cost: float
    rays: Integers
    point: int


@dataclass(frozen=True, slots=True, eq=False)
class Assigned:
    """The spots of n markers at t pulses.

    Attributes:
        rays: (t, n, m) index of the spot in each image; -1: none, or not to be told.
        xyz: (t, n, 3) intersection of the rays; NaN where there are not two, or some were ambiguous.
        covariance: (t, n, 3, 3) of it.
    """

    rays: Integers
    xyz: Floats
    covariance: Floats


def well_known(covariance: Floats) -> Flags:
    """Whether predictions with covariances (..., 3, 3) are of use."""
    return np.asarray(np.linalg.eigvalsh(covariance)[..., -1] < MOST_VAGUE_M**2)


def assign(
    views: Views,
    window: Window,
    predicted: Prediction,
    axes: Floats,
    before: tuple[Prediction, Assigned] | None = None,
) -> Assigned:
    """Assign the spots of t pulses to markers.

    Args:
        views: the cameras.
        window: the pulses.
        predicted: places of n markers.
        axes: of the flight (`flights.Flight`).
        before: what was assigned to other predictions; pulses with nearly the same ones keep it.
    """
    steps, n, _ = predicted.xyz.shape
    m = len(views)
    sizes = np.array([float(np.prod(placed.size)) for placed in views.placed])
    known = well_known(predicted.covariance)
    sights = [_Sights(views.see(k, predicted.xyz.reshape(-1, 3)), predicted.covariance) for k in range(m)]
    result = Assigned(np.full((steps, n, m), -1), np.full((steps, n, 3), np.nan), np.full((steps, n, 3, 3), np.nan))
    same = np.zeros(steps, bool) if before is None else _same(before[0], predicted)
    for t, rays in enumerate(window.rays):
        if before is not None and same[t]:
            for new, old in zip(_parts(result), _parts(before[1]), strict=True):
                new[t] = old[t]
            continue
        points = window.points[t]
        rate = 2 * np.log(2 * np.pi / DETECTED * (1 + np.array([len(r.xy) for r in rays])) / sizes)
        options = [[nothing(m)] for _ in range(n)]
        for i in np.flatnonzero(known[t]).tolist():
            own = [sight.of(t * n + i) for sight in sights]
            expected = window.delivered[t] & np.array([one.inside for one in own])
            missed = np.where(expected, -2 * np.log(1 - DETECTED), 0.0)
            found = _points(rays, points, predicted.xyz[t, i], predicted.covariance[t, i], rate - missed)
            found += _single_rays(own, rays, expected, rate - missed)
            options[i] += _worthy(found)
        strange = _strangeness(options, points, axes)
        for i, (option, doubtful) in enumerate(jointly_best(options, strange)):
            result.rays[t, i] = np.where(doubtful, -1, option.rays)
            if option.point >= 0 and not doubtful.any():
                result.xyz[t, i] = points.xyz[option.point]
                result.covariance[t, i] = points.covariance[option.point]
    return result


def _parts(assigned: Assigned) -> tuple[Any, Any, Any]:
    return assigned.rays, assigned.xyz, assigned.covariance


def _same(one: Prediction, other: Prediction) -> Flags:
    """Pulses (t,) whose predictions differ by little of their accuracy."""
    sigma = np.sqrt(np.diagonal(other.covariance, axis1=2, axis2=3))
    ratio = sigma / np.sqrt(np.diagonal(one.covariance, axis1=2, axis2=3))
    moved = np.abs(one.xyz - other.xyz) / sigma
    return np.asarray(((moved < _LITTLE) & (np.abs(ratio - 1) < _LITTLE)).all(axis=(1, 2)))


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """A predicted image point: (1, 2) px, (1, 2, 2) px^2 and whether it lies in the image."""

    xy: Floats
    covariance: Floats
    inside: bool


class _Sights:
    """Predicted image points of all markers at all pulses in one camera."""

    def __init__(self, sight: Sight, covariance: Floats) -> None:
        self._sight = sight
        spread = covariance.reshape(-1, 3, 3)
        self._spread = sight.by_point @ spread @ sight.by_point.transpose(0, 2, 1) + sight.noise

    def of(self, i: int) -> _Place:
        return _Place(self._sight.xy[i : i + 1], self._spread[i : i + 1], bool(self._sight.inside[i]))


def nothing(m: int) -> Option:
    """Nothing is found in m images."""
    return Option(0.0, np.full(m, -1), -1)


def _points(rays: Sequence[Rays], points: SpacePoints, xyz: Floats, covariance: Floats, rate: Floats) -> list[Option]:
    """Points in space that may be a marker; rate (m,): cost of a ray by chance and by not being missed."""
    if not len(points):
        return []
    off = points.xyz - xyz
    total = covariance + points.covariance
    distance = np.einsum("ni,ni->n", off, np.linalg.solve(total, off[..., None])[..., 0])
    options = []
    for j in np.flatnonzero(distance < gate(3)):
        seen = np.flatnonzero(points.rays[j] >= 0).tolist()
        area = sum(2 * np.log(rays[k].variance[points.rays[j, k]]) + rays[k].odd[points.rays[j, k]] for k in seen)
        area += np.linalg.slogdet(total[j])[1] - np.linalg.slogdet(points.covariance[j])[1]
        cost = points.misfit[j] + distance[j] + area + rate[seen].sum()
        options.append(Option(float(cost), points.rays[j], int(j)))
    return options


def _single_rays(places: Sequence[_Place], rays: Sequence[Rays], expected: Flags, rate: Floats) -> list[Option]:
    """Single spots that may be a marker; places: predicted, by camera."""
    options = []
    for k in np.flatnonzero(expected).tolist():
        distances = squared_distances(places[k].xy, places[k].covariance, rays[k])[0]
        for s in np.flatnonzero(distances < gate(2)):
            area = np.linalg.slogdet(places[k].covariance[0] + rays[k].covariance[s])[1]
            single = np.full(len(rays), -1)
            single[k] = s
            options.append(Option(float(distances[s] + rays[k].odd[s] + area + rate[k]), single, -1))
    return options


def _worthy(options: Sequence[Option]) -> list[Option]:
    """The best options: those that chance does not explain, and no single ray of a spot that a better one has."""
    kept: list[Option] = []
    for option in sorted(options, key=lambda o: o.cost):
        part = option.point < 0 and any((o.rays == option.rays)[option.rays >= 0].all() for o in kept)
        if option.cost < -DECISIVE and not part:
            kept.append(option)
    return kept[:MOST_OPTIONS]


def _strangeness(options: Sequence[Sequence[Option]], points: SpacePoints, axes: Floats) -> Strangeness:
    """Costs of two options being markers of one body: what looks like one costs nothing."""

    def cost(one: int, a: Option, other: int, b: Option) -> float:
        if a.point < 0 or b.point < 0:
            return 0.0
        difference = (points.xyz[b.point] - points.xyz[a.point]) @ axes.T
        return max(0.0, float(implausibility(one, other, difference[None])[0]) - USUAL)

    return {
        (i, p, j, q): cost(i, a, j, b)
        for (i, one), (j, other) in combinations(enumerate(options), 2)
        for p, a in enumerate(one)
        for q, b in enumerate(other)
    }


def jointly_best(
    options: Sequence[Sequence[Option]], strangeness: Strangeness | None = None
) -> list[tuple[Option, Flags]]:
    """The best option of each marker when no spot is used twice.

    Args:
        options: of each marker, nothing among them.
        strangeness: costs of two options together, by marker, option, other marker and its option.

    Returns:
        The option of each, and (m,) the images in which a rival is nearly as good.
    """
    used = [[{(k, s) for k, s in enumerate(o.rays.tolist()) if s >= 0} for o in of_marker] for of_marker in options]
    joint: list[tuple[float, tuple[int, ...]]] = [(0.0, ())]
    for i, of_marker in enumerate(options):
        joint = [
            (
                cost + option.cost + sum((strangeness or {}).get((j, q, i, p), 0.0) for j, q in enumerate(so_far)),
                (*so_far, p),
            )
            for cost, so_far in joint
            for p, option in enumerate(of_marker)
            if all(used[j][q].isdisjoint(used[i][p]) for j, q in enumerate(so_far))
        ]
    costs = np.array([cost for cost, _ in joint])
    spots = np.array([[options[i][p].rays for i, p in enumerate(picked)] for _, picked in joint])
    best = int(costs.argmin())
    rivals = costs - costs[best] < DECISIVE
    rivals[best] = False
    chosen = []
    for i, p in enumerate(joint[best][1]):
        mine = options[i][p].rays
        other_spot = (spots[rivals, i] != mine) & (spots[rivals, i] >= 0) & (mine >= 0)
        others = np.delete(spots[rivals], i, axis=1)
        elsewhere = ((others == mine) & (mine >= 0)).any(axis=1)
        chosen.append((options[i][p], np.asarray((other_spot | elsewhere).any(axis=0))))
    return chosen
