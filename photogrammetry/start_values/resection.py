"""Direct space resection with known interior orientation: no start values, three or more points, planar too.

Three points and their rays fix the three distances up to at most four solutions (Grunert's quartic). With more points
the solutions of several well-spread triples are judged by all points, and the best are refined by least squares.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.ideal_camera import Array, IdealCamera, unit_rays
from photogrammetry.similarity import fit_similarity
from photogrammetry.start_values.pose_refinement import RefinedPose, refine_pose
from rig.errors import BadInputError

_COLLINEAR = 1e-6  # height of a triangle over its longest side
_TINY = 1e-12
_TRIPLES = 5
_POLISH_STEPS = 20
_REFINED = 3  # candidates that are refined
_NEARLY_REAL = 0.2  # imaginary part of a root over its modulus: noise pushes double roots off the real axis
_SAME_TURN = 0.02  # rad,
_SAME_EXACT = 1e-5  # and where poses are exact: closer ones differ by rounding
_ROUNDING = 1e-7  # of c: residuals that small are none
_AMBIGUOUS = 4.0  # ratio of square sums below which a second pose remains possible


@dataclass(frozen=True, slots=True)
class Resection:
    """Pose of one image.

    Attributes:
        camera: the best pose.
        residuals: (n, 2) computed - observed.
        alternatives: other poses that fit nearly as well (three points; small planar fields), best first.
    """

    camera: IdealCamera
    residuals: Array
    alternatives: tuple[IdealCamera, ...]

    @property
    def ambiguous(self) -> bool:
        """Whether another pose fits nearly as well: then only further points decide."""
        return bool(self.alternatives)


def resect(points: ArrayLike, xy: ArrayLike, c: float) -> Resection:
    """Pose of one image from known points and interior orientation.

    Args:
        points: (n, 3) object coordinates, n >= 3, not on a line.
        xy: (n, 2) reduced image coordinates.
        c: principal distance, image unit.

    Returns:
        The pose with the smallest residuals and those that the points cannot tell from it.

    Raises:
        BadInputError: fewer than three points, points on a line, or points and image coordinates that fit no pose.
    """
    points, xy = np.asarray(points, float), np.asarray(xy, float)
    if len(points) < 3:
        raise BadInputError(f"a resection has {len(points)} known points: give at least three")
    triples = _triples(points)
    if not triples:
        raise BadInputError("the known points of a resection lie on a line: add one beside it")
    rays = unit_rays(xy, c)
    candidates = [
        RefinedPose(camera, _fit(camera, points, rays))
        for triple in triples
        for camera in _three_points(points[triple], rays[triple], c)
    ]
    # three points fit each of their poses exactly, and next to the danger cylinder two of them nearly coincide
    exact = len(points) == 3
    if not exact:
        candidates = _distinct(candidates, _SAME_TURN)[:_REFINED]
    refined = [refine_pose(candidate.camera, points, xy) for candidate in candidates]
    refined = _distinct([p for p in refined if np.isfinite(p.square_sum)], _SAME_EXACT if exact else _SAME_TURN)
    if not refined:
        raise BadInputError("the points of a resection fit no pose: check point numbers and principal distance")
    best = refined[0]
    limit = max(_AMBIGUOUS * best.square_sum, (_ROUNDING * c) ** 2)
    others = (pose.camera for pose in refined[1:] if pose.square_sum < limit)
    return Resection(best.camera, best.camera.project(points) - xy, tuple(others))


def _triples(points: Array) -> list[list[int]]:
    """Triples of points that span large triangles: the largest first, then those of other points."""
    chosen: list[list[int]] = []
    pool = np.arange(len(points))
    while len(chosen) < _TRIPLES and len(pool) >= 3:
        there = points[pool]
        a = int(np.linalg.norm(there - there.mean(axis=0), axis=1).argmax())
        away = there - there[a]
        b = int(np.linalg.norm(away, axis=1).argmax())
        heights = np.linalg.norm(np.cross(away, away[b]), axis=1)
        third = int(heights.argmax())
        if not heights[third] > _COLLINEAR * float(away[b] @ away[b]):
            break
        triple = [int(pool[i]) for i in (a, b, third)]
        chosen.append(triple)
        # the next triple leaves out one of these, so that every point has its turn and few points still give several
        pool = pool[pool != triple[len(chosen) % 3]]
    return chosen


def _three_points(points: Array, rays: Array, c: float) -> list[IdealCamera]:
    """Poses from three points (3, 3) and unit rays (3, 3) in the camera system."""
    cameras = []
    for distances in _distances(points, rays):
        fit = fit_similarity(rays * distances[:, None], points, scale=1.0).transform
        cameras.append(IdealCamera(c, fit.translation, fit.rotation))
    return cameras


def _distances(points: Array, rays: Array) -> list[Array]:
    """Distances (3,) from the projection centre to three points: the positive roots of Grunert's quartic."""
    a, b, c = (float(((points[i] - points[j]) ** 2).sum()) for i, j in ((1, 2), (0, 2), (0, 1)))
    cos_a, cos_b, cos_c = (float(rays[i] @ rays[j]) for i, j in ((1, 2), (0, 2), (0, 1)))
    p, q, s, t = (a - c) / b, (a + c) / b, c / b, a / b
    quartic = (
        (p - 1) ** 2 - 4 * s * cos_a**2,
        4 * (p * (1 - p) * cos_b - (1 - q) * cos_a * cos_c + 2 * s * cos_a**2 * cos_b),
        2 * (p**2 - 1 + 2 * (p * cos_b) ** 2 + 2 * (1 - s) * cos_a**2 - 4 * q * cos_a * cos_b * cos_c)
        + 4 * (1 - t) * cos_c**2,
        4 * (-p * (1 + p) * cos_b + 2 * t * cos_c**2 * cos_b - (1 - q) * cos_a * cos_c),
        (1 + p) ** 2 - 4 * t * cos_c**2,
    )
    found = []
    for root in np.roots(quartic):
        v = float(root.real)
        if v <= 0 or abs(root.imag) > _NEARLY_REAL * abs(root):
            continue
        square, divisor = 1 + v * v - 2 * v * cos_b, 2 * (cos_c - v * cos_a)
        if square < _TINY or abs(divisor) < _TINY:
            continue  # two rays coincide
        first = np.sqrt(b / square)
        u = ((p - 1) * v * v - 2 * p * cos_b * v + 1 + p) / divisor
        if u > 0:
            found.append(_polished(first * np.array([1.0, u, v]), np.array([a, b, c]), np.array([cos_a, cos_b, cos_c])))
    return found


def _polished(distances: Array, squares: Array, cosines: Array) -> Array:
    """Distances improved on the three triangles themselves: next to a double root the quartic has lost digits.

    Args:
        distances: (3,) from a root.
        squares: (3,) squared sides opposite to the points.
        cosines: (3,) of the angles between the rays to their ends.
    """
    best, least = distances, np.inf
    for _ in range(_POLISH_STEPS):
        one, other = np.roll(distances, -1), np.roll(distances, 1)
        errors = one**2 + other**2 - 2 * one * other * cosines - squares
        size = float(np.abs(errors / squares).max())
        if not size < least or np.any(distances <= 0.0):
            break
        best, least = distances, size
        jacobian = np.zeros((3, 3))
        for k in range(3):
            jacobian[k, (k + 1) % 3] = 2 * (one[k] - other[k] * cosines[k])
            jacobian[k, (k + 2) % 3] = 2 * (other[k] - one[k] * cosines[k])
        distances = distances - np.linalg.lstsq(jacobian, errors, rcond=None)[0]
    return best


def _fit(camera: IdealCamera, points: Array, rays: Array) -> float:
    """Median squared sine between rays and points; also finite where a poor candidate has points behind it."""
    d = (points - camera.X0) @ camera.R
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    square = ((d - rays) ** 2).sum(axis=1)
    return float(square.mean())


def _distinct(poses: list[RefinedPose], same: float) -> list[RefinedPose]:
    """Poses by square sum, of each bundle of nearly equal ones the best."""
    kept: list[RefinedPose] = []
    for pose in sorted(poses, key=lambda candidate: candidate.square_sum):
        turns = [np.arccos(np.clip((np.trace(other.camera.R.T @ pose.camera.R) - 1) / 2, -1, 1)) for other in kept]
        if all(turn > same for turn in turns):
            kept.append(pose)
    return kept
