"""Normal equations in two blocks: kept unknowns (cameras, poses, tied points), and points that are eliminated.

The elimination is a Schur complement. All matrices are scaled to a unit diagonal of the normal matrix (the unit of each
unknown is its standard deviation with the others fixed), because unknowns differ in size: a3 ~ 1e-21, c ~ 1e3.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import lapack

from photogrammetry.adjustment.equations.problem import Equations, Problem
from photogrammetry.adjustment.equations.unknowns import NONE
from rig.arrays import Floats, Integers

#: With a reciprocal condition below this the solution has no correct digit.
_BROKEN = 1e-16


class SingularError(Exception):
    """The normal matrix has no Cholesky factor, or hardly one."""


@dataclass(frozen=True, slots=True, eq=False)
class Normals:
    """The normal matrix N and the gradient J^T v, scaled to a unit diagonal.

    Attributes:
        n11: (u1, u1) kept unknowns.
        n12: (u1, 3 pe).
        n22: (pe, 3, 3).
        gradient: (u,).
        scale: (u,): unknown = scale * scaled unknown.
    """

    n11: Floats
    n12: Floats
    n22: Floats
    gradient: Floats
    scale: Floats

    def times(self, vectors: Floats) -> Floats:
        """Product of the scaled normal matrix with scaled vectors (u, m)."""
        split = len(self.n11)
        first, second = vectors[:split], vectors[split:]
        blocks = second.reshape(len(self.n22), 3, vectors.shape[1])
        lower = self.n12.T @ first + (self.n22 @ blocks).reshape(second.shape)
        return np.concatenate([self.n11 @ first + self.n12 @ second, lower])


@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """The reduced normal matrix, factorised; the datum directions of a free network are added to make it regular.

    Attributes:
        normals: the normal equations that were factorised.
        cholesky: (u1, u1) lower triangle.
        gain: (pe, 3, u1) = N22^-1 N21.
        inverse22: (pe, 3, 3).
        free: (u1, d) orthonormal null directions, scaled.
        condition: reciprocal condition number of the reduced matrix (1-norm, estimated).
    """

    normals: Normals
    cholesky: Floats
    gain: Floats
    inverse22: Floats
    free: Floats
    condition: float

    def solve(self) -> Floats:
        """The Gauss-Newton step -N^-1 J^T v of all unknowns (u,), unscaled."""
        normals, split = self.normals, len(self.cholesky)
        g1, g2 = normals.gradient[:split], normals.gradient[split:].reshape(-1, 3)
        first = -g1 + np.einsum("pau,pa->u", self.gain, g2)
        first -= self.free @ (self.free.T @ first)  # removes rounding along the datum directions
        if split:
            first, _ = lapack.dpotrs(self.cholesky, first, lower=1)
        second = -np.einsum("pab,pb->pa", self.inverse22, g2) - self.gain @ first
        step: Floats = np.concatenate([first, second.ravel()]) * normals.scale
        return step

    def cofactors(self) -> Floats:
        """Q = N^-1 of all unknowns (u, u), unscaled; of a free network the reflexive inverse of the kept unknowns."""
        split, pe = len(self.cholesky), len(self.inverse22)
        q11 = np.zeros((split, split))
        if split:
            inverse, _ = lapack.dpotri(self.cholesky, lower=1)
            q11 = np.tril(inverse) + np.tril(inverse, -1).T
        q11 -= self.free @ self.free.T
        gain = self.gain.reshape(3 * pe, split)
        q21 = -gain @ q11
        q = np.empty((split + 3 * pe, split + 3 * pe))
        q[:split, :split] = q11
        q[split:, :split], q[:split, split:] = q21, q21.T
        q22 = -q21 @ gain.T
        q[split:, split:] = q22
        rows = split + np.arange(3 * pe).reshape(pe, 3)
        q[rows[:, :, None], rows[:, None, :]] += self.inverse22
        q *= self.normals.scale[:, None]
        q *= self.normals.scale
        return q


def build_normals(problem: Problem, equations: Equations) -> Normals:
    """Form the normal equations."""
    unknowns, columns = problem.unknowns, problem.global_columns()
    end, split, u = unknowns.n_poses_end, unknowns.n_kept_end, unknowns.count
    ordered = np.concatenate([unknowns.kept, unknowns.eliminated])
    # One more row and column collect the terms of constants (index -1), and are cut off.
    n_gg, gradient = _global_part(problem, equations, columns, end)
    n_gp, n_pp, g_p = _point_part(problem, equations, end)
    n_gp, n_pp = n_gp[:, ordered], n_pp[ordered]
    gradient = np.concatenate([gradient[:end], g_p[ordered].ravel()])

    kept = len(unknowns.kept)
    n11 = np.zeros((split, split))
    n11[:end, :end] = n_gg[:end, :end]
    n11[:end, end:] = n_gp[:end, :kept].reshape(end, 3 * kept)
    n11[end:, :end] = n11[:end, end:].T
    rows = end + np.arange(3 * kept).reshape(kept, 3)
    n11[rows[:, :, None], rows[:, None, :]] = n_pp[:kept]
    n12 = np.zeros((split, u - split))
    n12[:end] = n_gp[:end, kept:].reshape(end, u - split)
    n22 = n_pp[kept:].copy()
    _add_relations(equations, n11, n22, gradient)
    return _scaled(n11, n12, n22, gradient)


def _global_part(problem: Problem, equations: Equations, columns: Integers, end: int) -> tuple[Floats, Floats]:
    """Normal matrix and gradient of camera parameters and poses, image by image."""
    k = columns.shape[1]
    n_gg, gradient = np.zeros((end + 1, end + 1)), np.zeros(end + 1)
    flat = np.concatenate([equations.by_global, equations.v[:, :, None]], axis=2).reshape(-1, k + 1)
    for image, (begin, stop) in enumerate(zip(problem.start[:-1].tolist(), problem.start[1:].tolist(), strict=True)):
        if begin == stop:
            continue
        part = flat[2 * begin : 2 * stop]
        product = part[:, :k].T @ part
        where = columns[image]
        n_gg[where[:, None], where] += product[:, :k]
        gradient[where] += product[:, k]
    return n_gg, gradient


def _point_part(problem: Problem, equations: Equations, end: int) -> tuple[Floats, Floats, Floats]:
    """Mixed and point blocks: (end + 1, points, 3), (points, 3, 3), and the points' gradient (points, 3)."""
    unknowns, by_point, by_global = problem.unknowns, equations.by_point, equations.by_global
    n, n_points = len(problem.image), len(unknowns.point)
    k = by_global.shape[2] - 6
    transposed = np.ascontiguousarray(by_point.transpose(0, 2, 1))
    mixed = (transposed @ by_global).transpose(0, 2, 1)
    blocks = (transposed @ by_point).reshape(n, 9)
    slopes = np.einsum("npr,nr->np", transposed, equations.v)
    n_gp = np.zeros((end + 1, n_points, 3))
    n_gp[unknowns.pose[problem.image], problem.point[:, None]] = mixed[:, k:]
    if k:
        summed = problem.by_camera_point @ np.ascontiguousarray(mixed[:, :k]).reshape(n, 3 * k)
        summed = summed.reshape(len(unknowns.camera), n_points, k, 3)
        for camera, where in enumerate(unknowns.camera):
            n_gp[where] = summed[camera].transpose(1, 0, 2)
    return n_gp, (problem.by_point @ blocks).reshape(-1, 3, 3), problem.by_point @ slopes


def _add_relations(equations: Equations, n11: Floats, n22: Floats, gradient: Floats) -> None:
    """Add the relations; those between points only tie kept points."""
    split, relations = len(n11), equations.relations
    columns, values = relations.columns, relations.values
    used = columns != NONE
    np.add.at(gradient, columns[used], (values * relations.v[:, None])[used])
    block, axis = np.divmod(columns[columns >= split] - split, 3)
    np.add.at(n22, (block, axis, axis), values[columns >= split] ** 2)
    tied = used & (columns < split)
    of_kept = np.flatnonzero(tied.any(axis=1))
    if not len(of_kept):
        return
    columns, values, tied = columns[of_kept], values[of_kept], tied[of_kept]
    row, one, other = np.nonzero(tied[:, :, None] & tied[:, None, :])
    np.add.at(n11, (columns[row, one], columns[row, other]), values[row, one] * values[row, other])


def _scaled(n11: Floats, n12: Floats, n22: Floats, gradient: Floats) -> Normals:
    diagonal = np.concatenate([np.diagonal(n11), np.diagonal(n22, axis1=1, axis2=2).ravel()])
    # an unknown without observations keeps its zero column; the rank analysis finds it
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    s1, s2 = scale[: len(n11)], scale[len(n11) :]
    blocks = s2.reshape(-1, 3)
    return Normals(
        n11 * s1[:, None] * s1,
        n12 * s1[:, None] * s2,
        n22 * blocks[:, :, None] * blocks[:, None, :],
        gradient * scale,
        scale,
    )


def reduce_points(normals: Normals, damping: float = 0.0) -> tuple[Floats, Floats, Floats]:
    """Eliminate the points that no relation ties to others.

    Returns:
        The reduced normal matrix (u1, u1), N22^-1 N21 (pe, 3, u1) and N22^-1 (pe, 3, 3).

    Raises:
        SingularError: a point is undetermined.
    """
    split = len(normals.n11)
    n22 = normals.n22 + damping * np.eye(3)
    try:
        inverse22: Floats = np.asarray(np.linalg.inv(n22), dtype=float)
    except np.linalg.LinAlgError:
        raise SingularError from None
    gain = inverse22 @ np.ascontiguousarray(normals.n12.T).reshape(len(n22), 3, split)
    reduced = normals.n11 - normals.n12 @ gain.reshape(3 * len(n22), split)
    reduced[np.diag_indices(split)] += damping
    return reduced, gain, inverse22


def factorise(normals: Normals, free: Floats, damping: float = 0.0) -> Factor:
    """Eliminate the points and factorise the reduced normal matrix.

    Args:
        normals: the normal equations.
        free: (u, d) scaled null directions of a free network; d = 0 if there are none.
        damping: added to the (unit) diagonal.

    Raises:
        SingularError: not positive definite to working precision.
    """
    split = len(normals.n11)
    reduced, gain, inverse22 = reduce_points(normals, damping)
    directions = np.zeros((split, 0))
    if free.shape[1] and damping == 0.0:
        directions, _ = np.linalg.qr(free[:split])
        reduced += directions @ directions.T
    if split == 0:
        return Factor(normals, reduced, gain, inverse22, directions, 1.0)
    norm = float(np.abs(reduced).sum(axis=0).max())
    cholesky, failed = lapack.dpotrf(reduced, lower=1)
    if failed:
        raise SingularError
    condition, _ = lapack.dpocon(cholesky, norm, uplo="L")
    if not condition > _BROKEN:
        raise SingularError
    return Factor(normals, cholesky, gain, inverse22, directions, float(condition))
