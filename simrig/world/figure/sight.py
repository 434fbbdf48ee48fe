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
    order = _order(scenario, pose, projection) if scenario.jumper.occlusion else []
    distances = projection.distance(pose.markers)
    shares = []
    for i, spot in enumerate(projection.pixels(pose.markers)):
        if not scenario.jumper.worn(jump)[i] or distances[i] <= 0 or not projection.sees(spot):
            shares.append(0.0)
            continue
        later = order[[thing.marker for thing in order].index(i) + 1 :] if order else []
        covers = [thing.part for thing in later if thing.part is not None and i not in thing.part.carries]
        disc = _disc(spot, scenario.jumper.marker_radius_m * projection.c / float(distances[i]))
        hidden = np.zeros(len(disc), bool)
        for cover in (*covers, *fronts):
            hidden |= _covered(disc, cover, projection) if isinstance(cover, Part) else inside(cover, disc)
        shares.append(1.0 - float(hidden.mean()))
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


def _disc(centre: Floats, radius: float) -> Floats:
    """Points spread evenly over a disc, shape (n, 2)."""
    k = np.arange(_SAMPLES)
    r = radius * np.sqrt((k + 0.5) / _SAMPLES)
    return np.asarray(centre + np.stack((r * np.cos(_SUNFLOWER * k), r * np.sin(_SUNFLOWER * k)), axis=1))


def _covered(points: Floats, part: Part, projection: Projection) -> Flags:
    """Whether points, px, shape (n, 2), lie in the image of a capsule."""
    ends, radii = body.outlines([part], projection)
    a, along = ends[0, 0], ends[0, 1] - ends[0, 0]
    square = float(along @ along)
    share = np.clip((points - a) @ along / square, 0, 1) if square > 0 else np.zeros(len(points))
    away = np.hypot(*(points - a - share[:, None] * along).T)
    covered: Flags = away < radii[0, 0] + (radii[0, 1] - radii[0, 0]) * share
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
