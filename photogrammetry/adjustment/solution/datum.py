"""The datum of a network: free similarity transformations, inner constraints, S-transformation."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from photogrammetry.adjustment.equations.problem import Problem
from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.solution.normals import Normals
from photogrammetry.geometry.rotation import nearest_rotation, skew
from photogrammetry.network.model import Network, Role
from rig.arrays import Floats, Integers

#: A direction is free if its scaled sum of squares is below this; rounding leaves less than 1e-15.
_FREE = 1e-14
#: A scaled datum condition below this does not fix its direction.
_FIXED = 1e-9
_ALIGNMENTS = 30
_ALIGNED = 1e-11  # of the network's size


class DatumError(Exception):
    """The chosen datum points do not define the datum; carries the number of conditions that are missing."""

    def __init__(self, missing: int):
        super().__init__()
        self.missing = missing


@dataclass(frozen=True, slots=True, eq=False)
class FreeDatum:
    """The similarity transformations that change no residual.

    Attributes:
        centre: (3,) of rotation and scale.
        directions: (7, d) in terms of translation (3), rotation (3), scale.
    """

    centre: Floats
    directions: Floats

    @property
    def defect(self) -> int:
        """Number of free transformations."""
        return int(self.directions.shape[1])


NOTHING_FREE = FreeDatum(np.zeros(3), np.zeros((7, 0)))


def similarity_directions(problem: Problem, state: State, centre: Floats) -> Floats:
    """Derivatives of all unknowns by translation (3), rotation (3, rad) and logarithm of the scale: (u, 7)."""
    unknowns = problem.unknowns
    out = np.zeros((unknowns.count + 1, 7))  # the last row collects the constants
    out[unknowns.pose[:, :3], :3] = np.eye(3)
    out[unknowns.pose[:, :3], 3:6] = -skew(state.position - centre)
    out[unknowns.pose[:, :3], 6] = state.position - centre
    out[unknowns.pose[:, 3:], 3:6] = np.swapaxes(state.rotation, 1, 2)
    out[unknowns.point, :3] = np.eye(3)
    out[unknowns.point, 3:6] = -skew(state.xyz - centre)
    out[unknowns.point, 6] = state.xyz - centre
    return out[:-1]


def find_free_datum(problem: Problem, normals: Normals, state: State, defect: int | None = None) -> FreeDatum:
    """Find the similarity transformations that change no residual, by the rank of the observations' changes.

    They may differ from state to state: where two coordinate differences fix the direction of a line, the network is
    free to turn about that line.

    Args:
        problem: the network made ready.
        normals: its normal equations at `state`.
        state: values.
        defect: their number, if it is known.
    """
    places = np.concatenate([state.xyz, state.position])
    centre = places.mean(axis=0) if len(places) else np.zeros(3)
    moves = similarity_directions(problem, state, centre) / normals.scale[:, None]
    # Orthonormal, so that the threshold means the same for a rotation and a translation.
    gram = moves.T @ moves
    length = np.sqrt(np.where(np.diagonal(gram) > 0.0, np.diagonal(gram), 1.0))
    values, vectors = np.linalg.eigh(gram / length[:, None] / length)
    usable = values > 1e-10
    basis = vectors[:, usable] / np.sqrt(values[usable]) / length[:, None]
    orthonormal = moves @ basis
    seen, combos = np.linalg.eigh(orthonormal.T @ normals.times(orthonormal))
    count = int(np.sum(seen < _FREE)) if defect is None else defect
    return FreeDatum(centre, basis @ combos[:, :count])


def datum_points(network: Network) -> Integers:
    """Indices of the datum points: those that the inner constraints sum over."""
    if network.datum.points is not None:
        return np.array(network.datum.points, dtype=np.intp)
    return np.array([i for i, point in enumerate(network.points) if point.role is not Role.FIXED], dtype=np.intp)


def inner_operator(problem: Problem, state: State, free: FreeDatum, points: Integers) -> tuple[Floats, Floats]:
    """The S-transformation I - H C to the datum of inner constraints over `points`.

    Returns:
        H (u, d), the free directions, and C (d, u).

    Raises:
        DatumError: the points leave directions free (fewer than three, or on a line).
    """
    moves = similarity_directions(problem, state, free.centre) @ free.directions
    columns = problem.unknowns.point[points].ravel()
    chosen = np.zeros_like(moves)
    chosen[columns] = moves[columns]
    gram = chosen.T @ moves
    _require_full(gram, moves, columns)
    return moves, np.asarray(np.linalg.solve(gram, chosen.T), dtype=float)


def _require_full(gram: Floats, moves: Floats, columns: Integers) -> None:
    """Raise DatumError if some free direction does not move the datum points."""
    if not gram.size:
        return
    size = np.sqrt(np.diagonal(gram))
    reach = np.abs(moves[columns]).max() if len(columns) else 0.0
    length = np.where(size > _FIXED * reach, size, np.inf) if reach > 0.0 else np.full(len(gram), np.inf)
    values = np.linalg.eigvalsh(gram / length[:, None] / length)
    missing = int(np.sum(values < _FIXED))
    if missing:
        raise DatumError(missing)


def s_transform(cofactors: Floats, moves: Floats, conditions: Floats) -> Floats:
    """Cofactors in another datum: S Q S^T with S = I - H C (any Q of the same network, any datum)."""
    if moves.shape[1] == 0:
        return cofactors
    half = conditions @ cofactors
    core = half @ conditions.T
    mixed = moves @ (half - 0.5 * core @ moves.T)
    transformed: Floats = cofactors - mixed
    transformed -= mixed.T
    return transformed


def transform_state(problem: Problem, state: State, centre: Floats, motion: Floats) -> State:
    """Apply a finite similarity transformation to all unknowns.

    Args:
        problem: says what is unknown; constants stay (a free direction does not move them).
        state: before.
        centre: (3,).
        motion: (7,) generator: translation, rotation vector, logarithm of the scale.
    """
    generator = np.zeros((4, 4))
    generator[:3, :3] = skew(motion[3:6]) + motion[6] * np.eye(3)
    generator[:3, 3] = motion[:3]
    full = expm(generator)
    turn = nearest_rotation(full[:3, :3])
    posed, unknown = problem.unknowns.pose[:, :1] >= 0, problem.unknowns.point[:, :1] >= 0
    return State(
        state.interior,
        np.where(posed, (state.position - centre) @ full[:3, :3].T + full[:3, 3] + centre, state.position),
        np.where(posed[:, :, None], turn @ state.rotation, state.rotation),
        np.where(unknown, (state.xyz - centre) @ full[:3, :3].T + full[:3, 3] + centre, state.xyz),
    )


def align(problem: Problem, state: State, free: FreeDatum, points: Integers, target: Floats) -> State:
    """Bring a free network into its datum: move the datum points as near to `target` as the free motions allow.

    Args:
        problem: the problem.
        state: after the adjustment, in any datum.
        free: the free motions.
        points: indices of the datum points.
        target: (points, 3) coordinates of all points before the adjustment.

    Raises:
        DatumError: the datum points do not define the datum.
    """
    columns = problem.unknowns.point[points].ravel()
    for _ in range(_ALIGNMENTS):
        moves, _conditions = inner_operator(problem, state, free, points)
        slopes = moves[columns]
        off = (target[points] - state.xyz[points]).ravel()
        motion, *_ = np.linalg.lstsq(slopes, off, rcond=None)
        state = transform_state(problem, state, free.centre, free.directions @ motion)
        size = np.abs(state.xyz[points] - free.centre).max()
        if np.abs(slopes @ motion).max() <= _ALIGNED * size:
            break
    return state
