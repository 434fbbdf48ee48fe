"""Which share of a marker a camera sees, by the geometry that also paints the images.

Snow, glare and light are not considered: they veil a marker, but nothing is in front of it.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from rig.arrays import Flags, Floats
from simrig.world.figure import body
from simrig.world.figure.body import Ordered, Part
from simrig.world.jumper import Pose
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario

IN_SIGHT = 0.5  #: a marker is in sight if at least so much of its disc is
_SUNFLOWER = math.pi * (3 - math.sqrt(5))
_SAMPLES = 60


def _unit_disc() -> Floats:
    """Points spread evenly over the unit disc, shape (n, 2)."""
    k = np.arange(_SAMPLES)
    r = np.sqrt((k + 0.5) / _SAMPLES)
    return np.stack((r * np.cos(_SUNFLOWER * k), r * np.sin(_SUNFLOWER * k)), axis=1)


_DISC = _unit_disc()

Front = Part | Floats  #: a capsule, or a convex outline in px, shape (n, 2)


def visible_shares(
    scenario: Scenario, pose: Pose, projection: Projection, jump: int, fronts: Sequence[Front] = ()
) -> list[float]:
    """Share of the discs of P1..P4 that is in sight, 0 to 1.

    Args:
        scenario: says how large the markers are, which are missing, and whether body and skis hide them.
        pose: the jumper.
        projection: the camera.
        jump: number of the jump.
        fronts: what stands between camera and jumper.
    """
    distances, spots = projection.distance(pose.markers), projection.pixels(pose.markers)
    worn = scenario.jumper.worn(jump)
    shares = [float(on) for on in worn & (distances > 0) & projection.sees(spots)]
    if not any(shares) or not (scenario.jumper.occlusion or fronts):
        return shares
    order = _order(scenario, pose, projection) if scenario.jumper.occlusion else []
    places = {thing.marker: place for place, thing in enumerate(order)}
    own = [(place, thing.part) for place, thing in enumerate(order) if thing.part is not None]
    shapes = [part for _, part in own] + [front for front in fronts if isinstance(front, Part)]
    ends, radii = body.outlines(shapes, projection)
    outlined = [front for front in fronts if not isinstance(front, Part)]
    for i, spot in enumerate(spots):
        if not shares[i]:
            continue
        before = [place > places[i] and i not in part.carries for place, part in own]
        hiding = np.array(before + [True] * (len(shapes) - len(own)), bool)
        radius = scenario.jumper.marker_radius_m * projection.c / float(distances[i])
        hiding &= _covered(spot[None], ends, radii + 2 * radius)[:, 0]  # of the others no point can be hidden
        disc = spot + radius * _DISC
        hidden = _covered(disc, ends[hiding], radii[hiding]).any(axis=0)
        for polygon in outlined:
            hidden |= inside(polygon, disc)
        shares[i] = 1.0 - float(hidden.mean())
    return shares


def outline(corners: Floats, projection: Projection) -> Floats | None:
    """Convex outline, px, shape (n, 2), of a body with these corners, shape (m, 3); None if it is not in front."""
    if float(projection.distance(corners).min()) <= 0:
        return None
    return _hull(projection.pixels(corners))


def inside(polygon: Floats, points: Floats) -> Flags:
    """Whether points, shape (n, 2), lie inside a convex polygon, shape (m, 2)."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    to = points[:, None] - polygon
    turn = edges[:, 0] * to[..., 1] - edges[:, 1] * to[..., 0]
    return np.asarray((turn >= 0).all(axis=1) | (turn <= 0).all(axis=1))


def _order(scenario: Scenario, pose: Pose, projection: Projection) -> list[Ordered]:
    points = body.joints(pose, scenario.jumper.ski_length_m / 2)
    return body.in_order(body.parts(points, scenario.jumper, 0), pose.markers, projection)


def _covered(points: Floats, ends: Floats, radii: Floats) -> Flags:
    """Which points, px, shape (n, 2), lie in the images of which capsules, shape (m, n).

    Args:
        points: the points.
        ends: centres of the two balls of each capsule, px, shape (m, 2, 2).
        radii: of the balls, px, shape (m, 2).
    """
    a, along = ends[:, None, 0], (ends[:, 1] - ends[:, 0])[:, None]
    square = (along * along).sum(axis=-1)
    to = points - a
    share = ((to * along).sum(axis=-1) / np.where(square > 0, square, 1.0)).clip(0, 1)
    away = to - share[..., None] * along
    covered: Flags = np.hypot(away[..., 0], away[..., 1]) < radii[:, :1] + (radii[:, 1:] - radii[:, :1]) * share
    return covered


def _hull(points: Floats) -> Floats:
    """Convex hull, shape (m, 2), of points, shape (n, 2) (Andrew's monotone chain)."""
    ordered = sorted(map(tuple, points.tolist()))

    def chain(places: Iterable[tuple[float, ...]]) -> list[tuple[float, ...]]:
        found: list[tuple[float, ...]] = []
        for place in places:
            while len(found) > 1 and _turn(found[-2], found[-1], place) <= 0:
                found.pop()
            found.append(place)
        return found[:-1]

    return np.array(chain(ordered) + chain(reversed(ordered)))


def _turn(a: tuple[float, ...], b: tuple[float, ...], c: tuple[float, ...]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
