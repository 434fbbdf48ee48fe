"""Assigns the spots of each pulse to the predicted markers: jointly optimal over all markers and all images.

Every option of a marker (a point in space with its rays, a single ray, nothing) has the same currency: minus twice the
logarithm of its probability density against that of chance, which puts spots anywhere in an image. So an option with
three rays competes fairly with one of two, and a spot counts more where few others are.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np

from analysis.identification.over_time.prediction import Prediction
from analysis.identification.over_time.window import Window
from analysis.identification.space.body import USUAL, implausibility
from analysis.identification.space.sides import shown
from analysis.identification.space.space_points import Rays, SpacePoints
from analysis.identification.space.views import Views, gate
from rig.arrays import Flags, Floats, Integers

#: How much likelier than each rival, and than chance, an assignment must be: minus twice the logarithm of 1/1000.
DECISIVE = 13.8
DETECTED = 0.9  #: share of the markers that an image shows which are found as spots
#: By pair of markers, the first one before the second: (options of the first, options of the second).
Strangeness: TypeAlias = dict[tuple[int, int], Floats]

_LITTLE = 0.03  #: standard deviations: a prediction that changes by less keeps its assignment
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
        rays: (t, n, m) index of the spot in each image; -1: none, or ambiguous.
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
    result = Assigned(np.full((steps, n, m), -1), np.full((steps, n, 3), np.nan), np.full((steps, n, 3, 3), np.nan))
    known = well_known(predicted.covariance)
    if before is not None:
        same = _same(before[0], predicted)
        known &= ~same[:, None]
        for new, old in zip(_parts(result), _parts(before[1]), strict=True):
            new[same] = old[same]
    options = _options(views, window, predicted, known, axes[1])
    for t in np.flatnonzero(known.any(axis=1)).tolist():
        points = window.points[t]
        of_markers = [[nothing(m), *_worthy(options.get((t, i), ()))] for i in range(n)]
        if all(len(of_marker) == 1 for of_marker in of_markers):
            continue
        strange = _strangeness(of_markers, points, axes)
        for i, (option, doubtful) in enumerate(jointly_best(of_markers, strange)):
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


def nothing(m: int) -> Option:
    """The option that no spot in m images shows the marker."""
    return Option(0.0, np.full(m, -1), -1)


def _options(
    views: Views, window: Window, predicted: Prediction, known: Flags, left: Floats
) -> dict[tuple[int, int], list[Option]]:
    """What may be each marker, by pulse and marker; those that are not known (t, n) have none."""
    found: dict[tuple[int, int], list[Option]] = {}
    steps = np.flatnonzero(known.any(axis=1))
    if not len(steps):
        return found
    rays = [[window.rays[t][k] for t in steps] for k in range(len(views))]
    counts = np.array([[len(of.xy) for of in of_camera] for of_camera in rays])
    sizes = np.array([float(np.prod(placed.size)) for placed in views.placed])
    xyz, covariance, known = predicted.xyz[steps], predicted.covariance[steps], known[steps]
    rate = 2 * np.log(2 * np.pi / (DETECTED * shown(views, xyz, left)) * (1 + counts.T[:, None]) / sizes)
    sights = views.see_all(xyz.reshape(-1, 3))
    inside = np.stack([sight.inside.reshape(known.shape) for sight in sights], axis=2)
    expected = known[..., None] & window.delivered[steps][:, None] & inside
    # (t, n, m) cost of a ray by chance and by not being missed
    cost = rate + np.where(expected, 2 * np.log(1 - DETECTED), 0.0)
    points = [window.points[t] for t in steps]
    for t, i, option in _points(rays, points, xyz, covariance, known, cost):
        found.setdefault((int(steps[t]), i), []).append(option)
    for k, sight in enumerate(sights):
        spread = sight.by_point @ covariance.reshape(-1, 3, 3) @ sight.by_point.transpose(0, 2, 1) + sight.noise
        places = sight.xy.reshape(*known.shape, 2), spread.reshape(*known.shape, 2, 2)
        for t, i, s, value in _single_rays(places, rays[k], expected[..., k], cost[..., k]):
            single = np.full(len(views), -1)
            single[k] = s
            found.setdefault((int(steps[t]), i), []).append(Option(value, single, -1))
    return found


def _points(
    rays: Sequence[Sequence[Rays]],
    points: Sequence[SpacePoints],
    xyz: Floats,
    covariance: Floats,
    known: Flags,
    cost: Floats,
) -> Iterator[tuple[int, int, Option]]:
    """Points in space that may be markers: pulse, marker, option.

    Args:
        rays: by camera and pulse.
        points: by pulse.
        xyz: (t, n, 3) predicted, with covariance (t, n, 3, 3).
        covariance: see `xyz`.
        known: (t, n) which predictions are of use.
        cost: (t, n, m) of a ray by chance and by not being missed.
    """
    step, place = _numbered([len(of_pulse) for of_pulse in points])
    if not len(step):
        return
    all_xyz, own, misfit, all_rays = (
        np.concatenate([getattr(of_pulse, name) for of_pulse in points])
        for name in ("xyz", "covariance", "misfit", "rays")
    )
    off = all_xyz[:, None] - xyz[step]
    total = covariance[step] + own[:, None]
    distance = np.einsum("pni,pni->pn", off, np.linalg.solve(total, off[..., None])[..., 0])
    p, i = np.nonzero((distance < gate(3)) & known[step])
    area, by_chance = np.zeros(len(p)), np.zeros(len(p))
    for k, of_camera in enumerate(rays):
        first = np.cumsum([0, *(len(of.xy) for of in of_camera)])
        ray = all_rays[p, k]
        seen = ray >= 0
        at = first[step[p[seen]]] + ray[seen]
        area[seen] += 2 * np.log(np.concatenate([of.variance for of in of_camera])[at])
        area[seen] += np.concatenate([of.odd for of in of_camera])[at]
        by_chance[seen] += cost[step[p[seen]], i[seen], k]
    area += np.linalg.slogdet(total[p, i])[1] - np.linalg.slogdet(own[p])[1]
    costs = misfit[p] + distance[p, i] + area + by_chance
    for point, marker, value in zip(p.tolist(), i.tolist(), costs.tolist(), strict=True):
        yield int(step[point]), marker, Option(value, all_rays[point], int(place[point]))


def _single_rays(
    places: tuple[Floats, Floats], rays: Sequence[Rays], expected: Flags, cost: Floats
) -> Iterator[tuple[int, int, int, float]]:
    """Single spots of one camera that may be markers: pulse, marker, spot, cost.

    Args:
        places: (t, n, 2) predicted image points with covariances (t, n, 2, 2), px.
        rays: by pulse.
        expected: (t, n) which markers it may show.
        cost: (t, n) of a ray by chance and by not being missed.
    """
    step, place = _numbered([len(of_pulse.xy) for of_pulse in rays])
    if not len(step):
        return
    xy, covariance, odd = (
        np.concatenate([getattr(of_pulse, name) for of_pulse in rays]) for name in ("xy", "covariance", "odd")
    )
    total = places[1][step] + covariance[:, None]
    x, y = np.moveaxis(places[0][step] - xy[:, None], -1, 0)
    a, b, d = total[..., 0, 0], total[..., 0, 1], total[..., 1, 1]
    determinant = a * d - b * b
    distance = (d * x * x - 2 * b * x * y + a * y * y) / determinant
    with np.errstate(invalid="ignore"):
        spot, i = np.nonzero((distance < gate(2)) & expected[step])
    values = distance[spot, i] + odd[spot] + np.log(determinant[spot, i]) + cost[step[spot], i]
    yield from zip(step[spot].tolist(), i.tolist(), place[spot].tolist(), values.tolist(), strict=True)


def _numbered(counts: Sequence[int]) -> tuple[Integers, Integers]:
    """Of the elements of several lists, one after the other, the list and the place in it."""
    which = np.repeat(np.arange(len(counts)), counts)
    return which, np.arange(len(which)) - np.repeat(np.cumsum([0, *counts])[:-1], counts)


def _worthy(options: Sequence[Option]) -> list[Option]:
    """The best options that are likelier than chance; a single ray goes if a better option has its spot."""
    kept: list[Option] = []
    shown: set[tuple[int, int]] = set()
    for option in sorted((o for o in options if o.cost < -DECISIVE), key=lambda o: o.cost):
        spots = {(k, s) for k, s in enumerate(option.rays.tolist()) if s >= 0}
        if option.point >= 0 or not spots <= shown:
            kept.append(option)
            shown |= spots
        if len(kept) == MOST_OPTIONS:
            break
    return kept


def _strangeness(options: Sequence[Sequence[Option]], points: SpacePoints, axes: Floats) -> Strangeness:
    """Costs of two options being markers of one body: what looks like one costs nothing."""
    of_marker = [np.array([option.point for option in several]) for several in options]
    costs: Strangeness = {}
    for (i, one), (j, other) in combinations(enumerate(of_marker), 2):
        costs[i, j] = np.zeros((len(one), len(other)))
        p, q = np.nonzero((one[:, None] >= 0) & (other >= 0))
        if len(p):
            difference = (points.xyz[other[q]] - points.xyz[one[p]]) @ axes.T
            costs[i, j][p, q] = np.maximum(0.0, implausibility(i, j, difference) - USUAL)
    return costs


def jointly_best(
    options: Sequence[Sequence[Option]], strangeness: Strangeness | None = None
) -> list[tuple[Option, Flags]]:
    """The best option of each marker when no spot is used twice.

    Args:
        options: of each marker, nothing among them.
        strangeness: costs of two options together, by pair of markers.

    Returns:
        The option of each, and (m,) the images in which a rival is nearly as good.
    """
    rays = [np.array([option.rays for option in of_marker]) for of_marker in options]
    costs = _joint_costs(options, rays, strangeness or {})
    best = int(costs.argmin())
    rivals = np.flatnonzero(costs.ravel() - costs.flat[best] < DECISIVE)
    picked = np.unravel_index(rivals[rivals != best], costs.shape)
    spots = np.stack([own[p] for own, p in zip(rays, picked, strict=True)], axis=1)
    chosen = []
    for i, p in enumerate(np.unravel_index(best, costs.shape)):
        mine = rays[i][p]
        used = (spots == mine) & (mine >= 0)
        other_spot = (spots[:, i] >= 0) & (mine >= 0) & ~used[:, i]
        used[:, i] = False
        chosen.append((options[i][int(p)], np.asarray(other_spot.any(axis=0) | used.any(axis=(0, 1)))))
    return chosen


def _joint_costs(
    options: Sequence[Sequence[Option]], rays: Sequence[Integers], strangeness: Mapping[tuple[int, int], Floats]
) -> Floats:
    """Costs of all combinations, one axis for each marker; infinite where they use a spot twice."""
    costs = np.zeros(())
    for i, of_marker in enumerate(options):
        costs = costs[..., None] + np.array([option.cost for option in of_marker])
        for j in range(i):
            clash = ((rays[j][:, None] == rays[i]) & (rays[i] >= 0)).any(axis=2)
            pair = np.where(clash, np.inf, strangeness.get((j, i), 0.0))
            costs = costs + pair.reshape(len(options[j]), *(1,) * (i - j - 1), len(of_marker))
    return costs
