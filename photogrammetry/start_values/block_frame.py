"""Absolute orientation: transforms a block from its own system into the object system.

Three known points give the seven parameters in closed form. Otherwise known points, distances and coordinate
differences (Eq. 3: rods) are fitted together, from several starting rotations. Parameters that these leave undetermined
(a turn about the vertical, the whole datum of a free network) get arbitrary values; the rank analysis names them.
"""

from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from photogrammetry.geometry.rotation import cross, rotation_from_vector
from photogrammetry.geometry.similarity import Similarity, fit_similarity
from photogrammetry.network.model import Network, Role
from photogrammetry.start_values.image_block import ImageBlock
from rig.arrays import Floats, Integers
from rig.errors import BadInputError

_STEPS_MOST = 30
_SETTLED = 1e-14  # relative decrease of the square sum that ends the iteration
_GIVEN_UP = 1e8  # damping at which no shorter step decreases it
_ROBUST_ROUNDS = 8
_WRONG = 6.0  # times the typical residual: a larger one calls for the robust fit
_LENGTH = -1  # in place of an axis: the length of the vector was observed
_SAME_FIT = 1.05  # fits with square sums up to this ratio are equally good
_SMALL_FIT = 1e-6  # and so are all fits with a smaller square sum
_LEAST_SIGMA = 1e-4  # of the largest sigma or value: bounds the weight of error-free points


def orient_block(block: ImageBlock, network: Network) -> None:
    """Transform a block into the object system as far as the network determines it.

    Args:
        block: in any system; changed in place.
        network: gives control and fixed points, distances and differences; without any of these, the approximate
            coordinates of other points.
    """
    known = np.flatnonzero(block.known)
    given = [int(i) for i in known if network.points[i].role in {Role.CONTROL, Role.FIXED}]
    transform = _by_points(block, network, given)
    if transform is None:
        ties = _ties(block, network, given)
        if ties is not None:
            transform = _by_ties(block, network, ties)
        else:
            transform = _by_points(block, network, _approximate(block, network)) or _overlaid(block, network)
    if transform is not None:
        block.transform(transform)


def _approximate(block: ImageBlock, network: Network) -> list[int]:
    approximate = {Role.TIE, Role.CHECK}
    points = network.points
    return [int(i) for i in np.flatnonzero(block.known) if points[i].role in approximate and points[i].xyz is not None]


def _by_points(block: ImageBlock, network: Network, points: list[int]) -> Similarity | None:
    if len(points) < 3:
        return None
    try:
        return fit_similarity(block.xyz[points], np.array([network.points[i].xyz for i in points], float))
    except BadInputError:
        return None  # the points lie on a line: distances and differences may help


def _overlaid(block: ImageBlock, network: Network) -> Similarity | None:
    """For a block without ties: the transformation that puts it over the known points, so that all images face them."""
    known = {Role.CONTROL, Role.FIXED}
    given = np.array([p.xyz for p in network.points if p.role in known and p.xyz is not None], float).reshape(-1, 3)
    inside = block.xyz[block.known]
    if not len(given) or not len(inside):
        return None
    spread_given, spread_inside = given.std(axis=0).max(), inside.std(axis=0).max()
    scale = float(spread_given / spread_inside) if spread_given > 0 and spread_inside > 0 else 1.0
    return Similarity(scale, np.eye(3), given.mean(axis=0) - scale * inside.mean(axis=0))


@dataclass(frozen=True, slots=True, eq=False)
class _Ties:
    """q observations of the seven parameters: coordinates of points, of vectors, and lengths.

    Attributes:
        origin: (3,) in the block, the middle of the known points; the rotation is about it.
        vectors: (q, 3) point relative to the origin, or difference of two points, in the block.
        axis: (q,) which component in the object system was observed; _LENGTH: the length.
        shifted: (q,) 1 for a point, which the translation moves, 0 for a vector.
        values: (q,) observed.
        weights: (q,) reciprocal sigmas.
    """

    origin: Floats
    vectors: Floats
    axis: Integers
    shifted: Floats
    values: Floats
    weights: Floats

    def linearised(self, transform: Similarity) -> tuple[Floats, Floats]:
        """Weighted residuals (q,) and derivatives (q, 7) by log scale, turns in the object system, translation."""
        length = self.axis == _LENGTH
        moved = transform.scale * self.vectors @ transform.rotation.T
        direction = np.where(length[:, None], moved, np.eye(3)[self.axis])
        norm = np.linalg.norm(direction, axis=1, keepdims=True)
        direction = direction / np.where(norm > 0, norm, 1.0)
        computed = (direction * moved).sum(axis=1)
        shift = self.shifted[:, None] * direction
        jacobian = np.column_stack((computed, cross(moved, direction), shift))
        residuals = computed + shift @ transform.translation - self.values
        return residuals * self.weights, jacobian * self.weights[:, None]

    @property
    def fixes_scale(self) -> bool:
        """Whether the ties determine the scale: two different points, or a length or difference that is not zero."""
        points = self.vectors[self.shifted > 0]
        several = len(points) > 0 and bool(np.ptp(points, axis=0).max() > 0)
        return several or bool((self.values[self.shifted == 0] != 0).any())


def _ties(block: ImageBlock, network: Network, given: list[int]) -> _Ties | None:
    known = block.known
    origin = block.xyz[given].mean(axis=0) if given else np.zeros(3)
    rows: list[tuple[Floats, int, int, float, float]] = []
    for i in given:
        point = network.points[i]
        sigma = np.zeros(3) if point.sigma is None else point.sigma
        xyz = np.zeros(3) if point.xyz is None else point.xyz
        rows += [(block.xyz[i] - origin, axis, 1, float(xyz[axis]), float(sigma[axis])) for axis in range(3)]
    for distance in network.distances:
        if known[distance.start] and known[distance.end]:
            chord = block.xyz[distance.end] - block.xyz[distance.start]
            rows.append((chord, _LENGTH, 0, distance.value, distance.sigma))
    for step in network.differences:
        if known[step.start] and known[step.end]:
            chord = block.xyz[step.end] - block.xyz[step.start]
            rows.append((chord, step.axis, 0, step.value, step.sigma))
    if not rows:
        return None
    vectors, axes, shifted, values, sigmas = (np.array(column, float) for column in zip(*rows, strict=True))
    largest = max(float(sigmas.max()), _LEAST_SIGMA * float(np.abs(values).max())) or 1.0
    return _Ties(origin, vectors, axes.astype(np.intp), shifted, values, 1 / np.maximum(sigmas, _LEAST_SIGMA * largest))


def _by_ties(block: ImageBlock, network: Network, ties: _Ties) -> Similarity:
    scale, origin = _first_scale(ties), np.zeros(3)
    fits = [_improved(ties, Similarity(scale, rotation, origin)) for rotation in _cube_rotations()]
    least = min(square_sum for _, square_sum in fits)
    residuals, _ = ties.linearised(min(fits, key=lambda fit: fit[1])[0])
    if np.abs(residuals).max() > _WRONG * _typical(residuals):
        fits = [_robustly_fitted(ties, rotation) for rotation in _cube_rotations()]
        least = min(square_sum for _, square_sum in fits)
    good = [fit for fit, square_sum in fits if square_sum <= _SAME_FIT * least + _SMALL_FIT]
    shifts = [fit.translation - fit.scale * fit.rotation @ ties.origin for fit in good]
    moved = [Similarity(fit.scale, fit.rotation, shift) for fit, shift in zip(good, shifts, strict=True)]
    return min(moved, key=lambda transform: _oddness(block, network, transform))


def _typical(residuals: Floats) -> float:
    return max(float(np.median(np.abs(residuals))) / 0.6745, 1.0)


def _robustly_fitted(ties: _Ties, rotation: Floats) -> tuple[Similarity, float]:
    """The fit with reweighting (Cauchy): one wrong image point spoils all ties of its point."""
    transform = Similarity(_first_scale(ties), rotation, np.zeros(3))
    for _ in range(_ROBUST_ROUNDS):
        residuals, _ = ties.linearised(transform)
        doubt = np.hypot(1.0, residuals / (2.0 * _typical(residuals)))
        transform, _ = _improved(replace(ties, weights=ties.weights / doubt), transform)
    residuals, _ = ties.linearised(transform)
    return transform, float(np.log1p(residuals**2).sum())


def _cube_rotations() -> list[Floats]:
    """The 24 rotations that map the axes onto axes."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        matrix = np.eye(3)[list(order)] * np.array(signs)[:, None]
        if np.linalg.det(matrix) > 0:
            found.append(matrix)
    return found


def _improved(ties: _Ties, transform: Similarity) -> tuple[Similarity, float]:
    """Damped Gauss-Newton; parameters that the ties do not determine stay."""
    residuals, jacobian = ties.linearised(transform)
    damping = 1e-3
    for _ in range(_STEPS_MOST):
        if not ties.fixes_scale:
            jacobian[:, 0] = 0.0
        normal = jacobian.T @ jacobian
        # relative damping; the second term keeps undetermined parameters where they are
        normal += np.diag(damping * np.diag(normal) + 1e-12 * np.trace(normal))
        step = np.asarray(np.linalg.solve(normal, -jacobian.T @ residuals), float)
        candidate = Similarity(
            float(transform.scale * np.exp(np.clip(step[0], -1, 1))),
            rotation_from_vector(step[1:4]) @ transform.rotation,
            transform.translation + step[4:],
        )
        new_residuals, new_jacobian = ties.linearised(candidate)
        before, after = residuals @ residuals, new_residuals @ new_residuals
        if after < before:
            transform, residuals, jacobian, damping = candidate, new_residuals, new_jacobian, damping / 10
            if after > (1 - _SETTLED) * before:
                break
        elif (damping := damping * 10) > _GIVEN_UP:
            break
    return transform, float(residuals @ residuals)


def _first_scale(ties: _Ties) -> float:
    """Scale from lengths, else from the spread of known points, else from the largest difference."""
    norms = np.linalg.norm(ties.vectors, axis=1)
    lengths = ties.axis == _LENGTH
    points = ties.shifted > 0
    if lengths.any():
        return float(np.abs(ties.values[lengths]).sum() / norms[lengths].sum())
    if ties.fixes_scale and points.sum() > 3:
        inside, outside = ties.vectors[points][::3], ties.values[points].reshape(-1, 3)
        return float(np.linalg.norm(np.ptp(outside, axis=0)) / np.linalg.norm(np.ptp(inside, axis=0)))
    if ties.fixes_scale:
        largest = int(np.argmax(np.where(points, 0.0, np.abs(ties.values))))
        return float(abs(ties.values[largest]) / norms[largest])
    return 1.0


def _oddness(block: ImageBlock, network: Network, transform: Similarity) -> float:
    """Smallest for the fit nearest to approximate coordinates; without any, for upright images with X to the right."""
    rough = _approximate(block, network)
    if rough:
        given = np.array([network.points[i].xyz for i in rough], float)
        return float(((transform.apply(block.xyz[rough]) - given) ** 2).sum())
    axes = [transform.turn(camera.R) for camera in block.cameras.values()]
    return -float(sum(turned[2, 1] + turned[0, 0] for turned in axes))
