"""How strong a network is by its shape: intersection angles of the points, coverage of the images."""

from itertools import pairwise

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.reports.document import Table
from rig.arrays import Floats

_CORNERS = 3  # points that span an area


def intersection_angles(a: Adjustment) -> Floats:
    """The angle nearest to a right one at which two rays of each point meet, rad, (points,); NaN below two rays."""
    problem = a.problem
    away = a.state.xyz[problem.point] - a.state.position[problem.image]
    with np.errstate(invalid="ignore", divide="ignore"):
        away = away / np.linalg.norm(away, axis=1, keepdims=True)
    order = np.argsort(problem.point, kind="stable")
    ends = np.searchsorted(problem.point[order], np.arange(len(a.network.points) + 1))
    angles = np.full(len(a.network.points), np.nan)
    for i, (begin, stop) in enumerate(pairwise(ends)):
        if stop - begin > 1:
            rays = away[order[begin:stop]]
            angles[i] = np.arccos(min(1.0, float(np.abs(rays @ rays.T).min())))
    return angles


def coverage_parts(a: Adjustment) -> tuple[str | Table, ...]:
    """How much of each image its points cover, and how much all images of a camera cover together."""
    network, start = a.network, a.problem.start
    rows = [
        _covered(image.name, image.camera, a, a.problem.xy[start[i] : start[i + 1]])
        for i, image in enumerate(network.images)
    ]
    if len(network.images) > len(network.cameras):
        rows += [
            _covered(f"camera {camera.name}", i, a, a.problem.xy[a.problem.camera == i])
            for i, camera in enumerate(network.cameras)
        ]
    if not len(a.problem.xy):
        return ()
    return (
        "area: convex hull of the points over the image; reach: radius of the outermost point over the half diagonal",
        Table(("image", "points", "area", "reach"), tuple(rows)),
    )


def _covered(name: str, camera: int, a: Adjustment, xy: Floats) -> tuple[str, ...]:
    size = a.network.cameras[camera].size
    if size is None or not len(xy):
        return name, str(len(xy)), "-", "-"
    reach = float(np.linalg.norm(xy, axis=1).max()) / (0.5 * float(np.hypot(*size)))
    return name, str(len(xy)), f"{_hull(xy) / (size[0] * size[1]):.0%}", f"{reach:.0%}"


def _hull(xy: Floats) -> float:
    """Area of the convex hull; zero for points on a line."""
    if len(xy) < _CORNERS:
        return 0.0
    try:
        return float(ConvexHull(xy).volume)
    except QhullError:
        return 0.0
