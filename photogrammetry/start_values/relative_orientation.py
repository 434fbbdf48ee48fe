"""Relative orientation of two images without start values (section 1, Fig. 1).

The paper tries probable rotations R_j with linearly derived base components. This module takes the rotations from the
closed solutions of several sets of five points instead. For each, it derives the base linearly from all points; damped
Gauss-Newton steps refine the best. Blunders among many points are left out. The distinct minima with the points in
front of both cameras are the solutions: there may be several for five points, and two for points in a plane.

Condition: b . (u x R v) = 0 with u, v = (x, y, -c), divided by the root of the sum of the squared derivatives by the
four image coordinates: then its square sum is that of the residuals in the image, to second order of the residuals.
"""

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.geometry.rotation import cross, rotation_from_vector, skew
from photogrammetry.start_values.essential_matrix import essential_matrices, orientations_of
from rig.arrays import Flags, Floats
from rig.errors import BadInputError

_SETS = 16  # sets of five points
_STARTS = 12  # candidates that are refined, at most
_FIRST_STEPS, _FIRST_KEPT = 5, 5  # with many points only the best few are refined beyond the first steps
_SAME_RAD = 0.02  # rad: of candidates closer than that only the best is refined
_MANY_POINTS = 10  # points, from here on "many" for _FIRST_STEPS
_ENOUGH_TO_JUDGE = 20  # points; with fewer none is left out, the rest would fit a wrong solution too easily
_GOOD_SHARE = 0.75  # of the points are taken as good in any case
_OUTLIER = 6.0  # times the median residual: larger ones are blunders
_WORTH = 100.0  # blunders are left out only if that divides the square sum by more than this
_STEPS_MOST = 30
_SETTLED = 1e-9  # relative decrease of the square sum that ends the iteration
_GIVEN_UP = 1.0  # damping at which a start without any decrease is given up
_EPIPOLE = 1e-9  # least length of a derivative: guards points that lie in both epipoles
_SAME = 1e-3  # rad: rotations and bases closer than that are one solution
_POSSIBLE = 4.0  # ratio of square sums below which a second solution remains possible
_ROUNDING = 1e-7  # of c: smaller residuals are rounding

_Minima: TypeAlias = tuple[Floats, Floats, Floats]  # rotations (k, 3, 3), bases (k, 3), square sums (k,)


@dataclass(frozen=True, slots=True)
class RelativeOrientation:
    """Pose of the second image in the system of the first (X0 = 0, R = I), base of length 1.

    Attributes:
        rotation: (3, 3), columns are the second camera's axes.
        base: (3,) its projection centre, unit vector.
        residuals: (n,) distances, image unit: root of the smallest square sum of the four coordinates' corrections.
        square_sum: of the residuals, blunders left out.
        in_front: share of the points that lie before both cameras.
        parallax: mean angle (rad) between homologous rays.
        alternatives: other solutions that fit nearly as well, best first (they have no alternatives themselves).
    """

    rotation: Floats
    base: Floats
    residuals: Floats
    square_sum: float
    in_front: float
    parallax: float
    alternatives: tuple["RelativeOrientation", ...] = ()

    @property
    def ambiguous(self) -> bool:
        """Whether a second solution fits nearly as well; then a third image or further points must decide."""
        return bool(self.alternatives)

    def cameras(self, c_first: float, c_second: float) -> tuple[IdealCamera, IdealCamera]:
        """Both images in the model system."""
        return IdealCamera(c_first, np.zeros(3), np.eye(3)), IdealCamera(c_second, self.base, self.rotation)


def orient_relatively(first: ArrayLike, second: ArrayLike, c_first: float, c_second: float) -> RelativeOrientation:
    """Relative orientation from homologous points.

    Args:
        first: (n, 2) reduced coordinates in the first image, n >= 5.
        second: (n, 2) the same points in the second image.
        c_first: principal distance of the first image.
        c_second: that of the second.

    Returns:
        The solution with the smallest residuals, with the others that remain possible.

    Raises:
        BadInputError: fewer than five points, or points that allow no solution with the points before both cameras.
    """
    u, v = _vectors(np.asarray(first, float), c_first), _vectors(np.asarray(second, float), c_second)
    if len(u) < 5:
        raise BadInputError(f"a relative orientation has {len(u)} homologous points: give at least five")
    rounding = len(u) * (_ROUNDING * 0.5 * (c_first + c_second)) ** 2
    none_there = BadInputError(
        "homologous points allow no relative orientation: check point numbers and principal distance"
    )
    rotations, bases = _candidates(u / c_first, v / c_second)
    if not len(rotations):  # the closed solutions of five points may all be complex
        raise none_there
    good, minima = _robust_minima(rotations, bases, u, v)
    solutions = _solutions(*minima, u[good], v[good], rounding)
    if not solutions or solutions[0].in_front < 0.5:
        raise none_there
    limit = max(_POSSIBLE * solutions[0].square_sum, rounding)
    head, *others = (
        replace(s, residuals=_conditions(s.rotation[None], s.base[None], u, v)[0][0])
        for s in solutions
        if s.square_sum <= limit and s.in_front == solutions[0].in_front
    )
    return replace(head, alternatives=tuple(others))


def _robust_minima(rotations: Floats, bases: Floats, u: Floats, v: Floats) -> tuple[Flags, _Minima]:
    """Points that are no blunders (n,), and the minima of their square sums."""
    good = _good_points(rotations, bases, u, v)
    minima = _minima(rotations, u, v)
    if good.all():
        return good, minima
    without = _minima(rotations, u[good], v[good])
    again = _iterate(*without[:2], u, v, _STEPS_MOST)
    rotations, bases, sums = (np.concatenate(both) for both in zip(minima, again, strict=True))
    if without[2].min() * _WORTH > sums.min():
        return np.ones(len(u), bool), (rotations, bases, sums)
    good = _good_points(*without[:2], u, v)
    return good, _iterate(*without[:2], u[good], v[good], _STEPS_MOST)


def _minima(rotations: Floats, u: Floats, v: Floats) -> _Minima:
    """Minima reached from the best candidates, the base from all points: rotations, bases, square sums."""
    bases = _linear_bases(rotations, u, v)
    sums = (_conditions(rotations, bases, u, v)[0] ** 2).sum(axis=1)
    best = _distinct_starts(rotations, sums) if len(u) > 5 else list(range(len(rotations)))
    rotations, bases = rotations[best], bases[best]
    if len(u) >= _MANY_POINTS:
        rotations, bases, sums = _iterate(rotations, bases, u, v, _FIRST_STEPS)
        sums = np.where(_possible(rotations, bases, u, v), sums, np.inf)
        best = _distinct_starts(rotations, sums)[:_FIRST_KEPT]
        rotations, bases = rotations[best], bases[best]
    return _iterate(rotations, bases, u, v, _STEPS_MOST)


def _good_points(rotations: Floats, bases: Floats, u: Floats, v: Floats) -> Flags:
    """Points that are no blunders by the candidate that fits the most of them best; of few points all are good."""
    if len(u) < _ENOUGH_TO_JUDGE:
        return np.ones(len(u), bool)
    size = np.sort(np.abs(_conditions(rotations, bases, u, v)[0]), axis=1)
    least = int(np.ceil(_GOOD_SHARE * len(u)))
    best = int((size[:, :least] ** 2).sum(axis=1).argmin())
    limit = max(_OUTLIER * float(np.median(size[best])), float(size[best, least - 1]))
    residuals = _conditions(rotations[best : best + 1], bases[best : best + 1], u, v)[0][0]
    return np.asarray(np.abs(residuals) <= limit)


def _candidates(u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Rotations (k, 3, 3) and bases (k, 3): closed solutions of sets of five points, and of all together."""
    solutions = [essential_matrices(u[None], v[None])]
    if len(u) > 5:
        shuffled = np.random.default_rng(len(u))  # seeded, so that equal input gives equal output
        sets = np.array([shuffled.choice(len(u), 5, replace=False) for _ in range(_SETS)])
        solutions.append(essential_matrices(u[sets], v[sets]))
    return orientations_of(np.concatenate(solutions))


def _distinct_starts(rotations: Floats, sums: Floats) -> list[int]:
    """Indices of the best candidates, one of each group of nearly equal rotations."""
    kept: list[int] = []
    for i in np.argsort(sums, kind="stable"):
        if not (np.abs(rotations[kept] - rotations[i]).max(axis=(1, 2)) < _SAME_RAD).any():
            kept.append(int(i))
            if len(kept) == _STARTS:
                break
    return kept


def _vectors(xy: Floats, c: float) -> Floats:
    return np.column_stack((xy, np.full(len(xy), -c)))


def _linear_bases(rotations: Floats, u: Floats, v: Floats) -> Floats:
    """For each rotation the base (k, 3) nearest to all epipolar planes."""
    normals = cross(u, v @ rotations.transpose(0, 2, 1))
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-300)
    return np.asarray(np.linalg.eigh(normals.transpose(0, 2, 1) @ normals)[1][:, :, 0])


def _conditions(rotations: Floats, bases: Floats, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Normalised conditions (k, n) and derivatives (k, n, 5): three turns, two shifts of the base across itself."""
    turned = v @ rotations.transpose(0, 2, 1)
    across_base = skew(bases)
    normal = u @ across_base  # u x b: derivative by R v
    closure = np.einsum("kni,kni->kn", normal, turned)
    by_first = (turned @ across_base)[..., :2]
    in_second = normal @ rotations
    by_second = in_second[..., :2]
    root = np.sqrt(np.einsum("kni,kni->kn", by_first, by_first) + np.einsum("kni,kni->kn", by_second, by_second))
    root = np.maximum(root, _EPIPOLE * np.linalg.norm(u, axis=1))  # a point in both epipoles carries no information
    jacobian = np.empty((*closure.shape, 5))
    for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
        jacobian[..., i] = v[:, j] * in_second[..., k] - v[:, k] * in_second[..., j]
    for i, axes in enumerate(np.moveaxis(_across(bases), 2, 0)):
        jacobian[..., 3 + i] = np.einsum("kni,kni->kn", turned, u @ skew(axes))
    return -closure / root, jacobian / -root[..., None]


def _across(bases: Floats) -> Floats:
    """Two unit vectors (k, 3, 2) at right angles to each base."""
    helper = np.eye(3)[np.abs(bases).argmin(axis=1)]
    first = cross(bases, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack((first, cross(bases, first)), axis=2)


def _iterate(rotations: Floats, bases: Floats, u: Floats, v: Floats, steps: int) -> _Minima:
    """Damped Gauss-Newton from all starts together, each with its own damping."""
    damping = np.full(len(bases), 1e-3)
    values, jacobian = _conditions(rotations, bases, u, v)
    sums = (values**2).sum(axis=1)
    for _ in range(steps):
        normal = np.einsum("kni,knj->kij", jacobian, jacobian)
        gradient = np.einsum("kni,kn->ki", jacobian, values)
        diagonal = np.einsum("kii->ki", normal)
        damped = normal + np.einsum("ki,ij->kij", damping[:, None] * diagonal + 1e-12 * diagonal.max(), np.eye(5))
        step = -np.linalg.solve(damped, gradient[..., None])[..., 0]
        moved = bases + np.einsum("kit,kt->ki", _across(bases), step[:, 3:])
        moved /= np.linalg.norm(moved, axis=1, keepdims=True)
        turned = rotations @ rotation_from_vector(step[:, :3])
        new_values, new_jacobian = _conditions(turned, moved, u, v)
        new_sums = (new_values**2).sum(axis=1)
        better = new_sums < sums
        moving = np.where(better, new_sums < (1 - _SETTLED) * sums, damping < _GIVEN_UP)
        rotations = np.where(better[:, None, None], turned, rotations)
        bases = np.where(better[:, None], moved, bases)
        values = np.where(better[:, None], new_values, values)
        jacobian = np.where(better[:, None, None], new_jacobian, jacobian)
        sums = np.where(better, new_sums, sums)
        damping = np.clip(np.where(better, damping / 10, damping * 10), 1e-12, 1e8)
        if not moving.any():
            break
    return rotations, bases, sums


def _solutions(
    rotations: Floats, bases: Floats, sums: Floats, u: Floats, v: Floats, rounding: float
) -> list[RelativeOrientation]:
    """Distinct minima, those with most points in front first, then by square sum."""
    kept: list[RelativeOrientation] = []
    for i in np.argsort(sums):
        for base in (bases[i], -bases[i]):
            share = _share_in_front(rotations[i], base, u, v)
            same = any(
                np.abs(other.rotation - rotations[i]).max() < _SAME and np.abs(other.base - base).max() < _SAME
                for other in kept
            )
            if share >= 0.5 and not same:
                residuals = _conditions(rotations[i][None], base[None], u, v)[0][0]
                kept.append(
                    RelativeOrientation(
                        rotations[i], base, residuals, float(sums[i]), share, _parallax(rotations[i], u, v)
                    )
                )
    least = min((s.square_sum for s in kept), default=0.0)
    # noise may put a few points behind: the share counts in tenths, after a far larger square sum
    kept.sort(key=lambda s: (s.square_sum > 100 * least + rounding, -round(s.in_front, 1), s.square_sum))
    return kept


def _possible(rotations: Floats, bases: Floats, u: Floats, v: Floats) -> Flags:
    """Whether at least half of the points lie in front, with the base or its opposite."""
    shares = [
        max(_share_in_front(rotation, sign * base, u, v) for sign in (1, -1))
        for rotation, base in zip(rotations, bases, strict=True)
    ]
    return np.array(shares) >= 0.5


def _share_in_front(rotation: Floats, base: Floats, u: Floats, v: Floats) -> float:
    """Share of the points whose rays meet at positive distances from both projection centres."""
    a, b = u / np.linalg.norm(u, axis=1, keepdims=True), v @ rotation.T
    b = b / np.linalg.norm(b, axis=1, keepdims=True)
    dot = (a * b).sum(axis=1)
    along_a, along_b = a @ base, b @ base
    first = along_a - dot * along_b
    second = dot * along_a - along_b
    return float(((first > 0) & (second > 0)).mean())


def _parallax(rotation: Floats, u: Floats, v: Floats) -> float:
    a, b = u / np.linalg.norm(u, axis=1, keepdims=True), v @ rotation.T
    b = b / np.linalg.norm(b, axis=1, keepdims=True)
    return float(np.arctan2(np.linalg.norm(cross(a, b), axis=1), (a * b).sum(axis=1)).mean())
