"""Space resection: the pose of one image with known interior orientation from three or more known points.

`resect` needs no start values. Three points and their rays fix the three distances up to at most four solutions
(Grunert's quartic). With more points it computes the solutions of several well-spread triples, judges each by all
points, and refines the best by least squares (`refine_pose`). The points may lie in a plane, which has a `second_pose`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.geometry.ideal_camera import IdealCamera, unit_rays
from photogrammetry.geometry.rotation import cross, rotation_from_vector
from photogrammetry.geometry.similarity import fit_similarity
from rig.arrays import Floats
from rig.errors import BadInputError

_COLLINEAR = 1e-6  # height of a triangle over its longest side
_TINY = 1e-12
_TRIPLES = 5
_EACH, _NEXT, _LAST = np.array([0, 1, 2]), np.array([1, 2, 0]), np.array([2, 0, 1])  # corners of a triangle
_POLISH_STEPS = 20
_REFINED = 3  # candidates that are refined
_NEARLY_REAL = 0.2  # imaginary part of a root over its modulus: noise pushes double roots off the real axis
_SAME_TURN = 0.02  # rad: poses closer than that are one solution
_SAME_EXACT = 1e-5  # rad: the same for three points, whose poses are exact
_ROUNDING = 1e-7  # of c: smaller residuals are rounding
_AMBIGUOUS = 4.0  # ratio of square sums below which a second pose remains possible
_POINTS_OF_TWO_POSES = 5  # points that may have a second pose without lying in a plane
_MAX_STEPS = 30
_DAMPING = 1e-3
_TOO_DAMPED = 1e12
_SETTLED_DECREASE = 1e-9  # relative decrease of the square sum
_EXACT = 1e-12  # of c: with smaller residuals the iteration ends


@dataclass(frozen=True, slots=True)
class Resection:
    """Pose of one image.

    Attributes:
        camera: the best pose.
        residuals: (n, 2) computed - observed.
        alternatives: other poses that fit nearly as well (three points; small planar fields), best first.
    """

    camera: IdealCamera
    residuals: Floats
    alternatives: tuple[IdealCamera, ...]

    @property
    def ambiguous(self) -> bool:
        """Whether another pose fits nearly as well; then further points must decide."""
        return bool(self.alternatives)


@dataclass(frozen=True, slots=True)
class RefinedPose:
    """Pose with its square sum of residuals.

    Attributes:
        camera: the image's camera.
        square_sum: of the residuals, image unit squared; infinite if a point lies behind the camera.
    """

    camera: IdealCamera
    square_sum: float


def resect(points: ArrayLike, xy: ArrayLike, c: float) -> Resection:
    """Pose of one image from known points and interior orientation.

    Args:
        points: (n, 3) object coordinates, n >= 3, not on a line.
        xy: (n, 2) reduced image coordinates.
        c: principal distance, image unit.

    Returns:
        The pose with the smallest residuals, and the other poses that fit nearly as well.

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


def _triples(points: Floats) -> list[list[int]]:
    """Triples of points that span large triangles: the largest first, then those of other points."""
    chosen: list[list[int]] = []
    pool = np.arange(len(points))
    while len(chosen) < _TRIPLES and len(pool) >= 3:
        there = points[pool]
        a = int(np.linalg.norm(there - there.mean(axis=0), axis=1).argmax())
        away = there - there[a]
        b = int(np.linalg.norm(away, axis=1).argmax())
        heights = np.linalg.norm(cross(away, away[b]), axis=1)
        third = int(heights.argmax())
        if not heights[third] > _COLLINEAR * float(away[b] @ away[b]):
            break
        triple = [int(pool[i]) for i in (a, b, third)]
        chosen.append(triple)
        # the next triple leaves out one of these, so that few points still give several triples
        pool = pool[pool != triple[len(chosen) % 3]]
    return chosen


def _three_points(points: Floats, rays: Floats, c: float) -> list[IdealCamera]:
    """Poses from three points (3, 3) and unit rays (3, 3) in the camera system."""
    cameras = []
    for distances in _distances(points, rays):
        fit = fit_similarity(rays * distances[:, None], points, scale=1.0)
        cameras.append(IdealCamera(c, fit.translation, fit.rotation))
    return cameras


def _distances(points: Floats, rays: Floats) -> list[Floats]:
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


def _polished(distances: Floats, squares: Floats, cosines: Floats) -> Floats:
    """Distances improved by Newton steps on the three triangles: next to a double root the quartic loses digits.

    Args:
        distances: (3,) from a root.
        squares: (3,) squared sides opposite to the points.
        cosines: (3,) of the angles between the rays to their ends.
    """
    best, least = distances, np.inf
    for _ in range(_POLISH_STEPS):
        one, other = distances[_NEXT], distances[_LAST]
        errors = one**2 + other**2 - 2 * one * other * cosines - squares
        size = float(np.abs(errors / squares).max())
        if not size < least or np.any(distances <= 0.0):
            break
        best, least = distances, size
        jacobian = np.zeros((3, 3))
        jacobian[_EACH, _NEXT] = 2 * (one - other * cosines)
        jacobian[_EACH, _LAST] = 2 * (other - one * cosines)
        distances = distances - np.linalg.lstsq(jacobian, errors, rcond=None)[0]
    return best


def _fit(camera: IdealCamera, points: Floats, rays: Floats) -> float:
    """Mean squared chord between unit rays and directions to the points; finite also for points behind the camera."""
    d = (points - camera.X0) @ camera.R
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    square = ((d - rays) ** 2).sum(axis=1)
    return float(square.mean())


def _distinct(poses: list[RefinedPose], same: float) -> list[RefinedPose]:
    """Poses in the order of their square sums, the best of each group of nearly equal ones."""
    kept: list[RefinedPose] = []
    for pose in sorted(poses, key=lambda candidate: candidate.square_sum):
        if all(_turn(other.camera, pose.camera) > same for other in kept):
            kept.append(pose)
    return kept


def _turn(one: IdealCamera, other: IdealCamera) -> float:
    """Angle between two rotations, rad."""
    return float(np.arccos(np.clip((np.trace(one.R.T @ other.R) - 1) / 2, -1, 1)))


def second_pose(camera: IdealCamera, points: Floats, xy: Floats) -> RefinedPose | None:
    """The best pose beside the one that a camera has: the reflected one, or another one that few points allow.

    For the reflected one the points are mirrored in the camera system, across the plane through their centroid at right
    angles to the mean ray. Of a plane the mirror image is congruent, and from afar it looks the same: its pose leads to
    the second minimum of the resection (Schweighofer and Pinz 2006). Of few points those of three are tried too.

    Args:
        camera: at one minimum, all points in front of it.
        points: (n, 3) object coordinates, n >= 3, not on a line.
        xy: (n, 2) reduced image coordinates.

    Returns:
        The minimum with the smallest residuals, perhaps large ones; None if there is none but that of the camera.

    Raises:
        BadInputError: the points lie on a line.
    """
    k = (points - camera.X0) @ camera.R
    rays = k / np.linalg.norm(k, axis=1, keepdims=True)
    mean = rays.mean(axis=0) / np.linalg.norm(rays.mean(axis=0))
    mirrored = k - 2.0 * ((k - k.mean(axis=0)) @ mean)[:, None] * mean
    fit = fit_similarity(mirrored, points, scale=1.0)
    starts = [IdealCamera(camera.c, fit.translation, fit.rotation)]
    if len(points) <= _POINTS_OF_TWO_POSES:
        measured = unit_rays(xy, camera.c)
        of_three = [p for t in _triples(points) for p in _three_points(points[t], measured[t], camera.c)]
        candidates = _distinct([RefinedPose(p, _fit(p, points, measured)) for p in of_three], _SAME_TURN)
        starts += [candidate.camera for candidate in candidates[: _REFINED + 1]]
    here = refine_pose(camera, points, xy)
    found = (refine_pose(start, points, xy) for start in starts)
    others = [p for p in found if np.isfinite(p.square_sum) and _turn(here.camera, p.camera) > _SAME_TURN]
    return min(others, key=lambda other: other.square_sum, default=None)


def refine_pose(camera: IdealCamera, points: Floats, xy: Floats, steps: int = _MAX_STEPS) -> RefinedPose:
    """Damped Gauss-Newton on Eq. A1.

    Args:
        camera: start values; all points should lie in front of it.
        points: (n, 3) object coordinates.
        xy: (n, 2) reduced image coordinates.
        steps: at most so many.

    Returns:
        The pose at the minimum reached; the start values themselves if a point lies behind the camera there.
    """
    best = RefinedPose(camera, _square_sum(camera, points, xy))
    damping = _DAMPING
    nothing = len(points) * (_EXACT * camera.c) ** 2
    for _ in range(steps):
        if best.square_sum < nothing or not np.isfinite(best.square_sum):
            break
        residuals, jacobian = _linearised(best.camera, points, xy)
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ residuals
        damped = normal + damping * np.diag(np.diag(normal))
        step = np.asarray(np.linalg.lstsq(damped, gradient, rcond=None)[0], float)
        turned: Floats = best.camera.R @ rotation_from_vector(step[3:])
        candidate = IdealCamera(camera.c, best.camera.X0 + step[:3], turned)
        square_sum = _square_sum(candidate, points, xy)
        if square_sum < best.square_sum:
            settled = square_sum > (1 - _SETTLED_DECREASE) * best.square_sum
            best, damping = RefinedPose(candidate, square_sum), damping / 10
            if settled:
                break
        else:
            damping *= 10
            if damping > _TOO_DAMPED:
                break
    return best


def _square_sum(camera: IdealCamera, points: Floats, xy: Floats) -> float:
    if not camera.in_front(points).all():
        return np.inf
    return float(((camera.project(points) - xy) ** 2).sum())


def _linearised(camera: IdealCamera, points: Floats, xy: Floats) -> tuple[Floats, Floats]:
    """Residuals observed - computed (2 n,) and derivatives (2 n, 6) by X0 and by turns about the camera's axes."""
    k = (points - camera.X0) @ camera.R
    image = -camera.c * k[:, :2] / k[:, 2:]
    by_k = np.zeros((len(k), 2, 3))
    by_k[:, 0, 0] = by_k[:, 1, 1] = -camera.c / k[:, 2]
    by_k[:, :, 2] = -image / k[:, 2:]
    by_turn = cross(by_k, k[:, None, :])
    jacobian = np.concatenate((-by_k @ camera.R.T, by_turn), axis=2)
    return (xy - image).ravel(), jacobian.reshape(-1, 6)
