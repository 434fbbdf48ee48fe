"""Closed solutions of the relative orientation of five points: essential matrices and the rotations in them.

E = [b]x R satisfies u^T E v = 0 for each pair of rays, det E = 0 and 2 E E^T E = tr(E E^T) E. Five pairs leave four
matrices; the cubic constraints on their combination are ten equations in the twenty monomials of three unknowns. Solved
for the ten cubic monomials, they give the matrix of multiplication by the first unknown, whose eigenvectors hold the
up to ten solutions.
"""

from itertools import combinations_with_replacement, product

import numpy as np

from photogrammetry.ideal_camera import Array

#: Exponent tuples as sorted index triples of (x, y, z, 1): ten cubic ones, then those of degree two, one and zero.
_MONOMIALS: list[tuple[int, ...]] = sorted(
    combinations_with_replacement(range(4), 3), key=lambda triple: (triple.count(3), triple)
)
_COLLAPSE = np.zeros((64, 20))
for _row, _triple in enumerate(product(range(4), repeat=3)):
    _COLLAPSE[_row, _MONOMIALS.index(tuple(sorted(_triple)))] = 1.0
_LOWER = _MONOMIALS[10:]
_TIMES_X = [_MONOMIALS.index(tuple(sorted((0, *triple[:2])))) for triple in _LOWER]  # triple ends in 3, the factor 1
_LEVI_CIVITA = np.zeros((3, 3, 3))
for _i, _j, _k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    _LEVI_CIVITA[_i, _j, _k], _LEVI_CIVITA[_k, _j, _i] = 1.0, -1.0
_REAL = 1e-6  # imaginary part over modulus below which an eigenvector is real


def essential_matrices(u: Array, v: Array) -> Array:
    """Essential matrices of homologous rays.

    Args:
        u: (n, 3) rays of the first image in its camera system, any length near 1; n >= 5.
        v: (n, 3) the same of the second image.

    Returns:
        (k, 3, 3), k = 0..10, norm 1. With more than five pairs: of the four matrices that fit best.
    """
    rows = np.einsum("ni,nj->nij", u, v).reshape(-1, 9)
    space = np.linalg.svd(rows)[2][-4:].reshape(4, 3, 3)
    e = space.transpose(1, 2, 0)
    cubic = 2 * np.einsum("iap,jaq,jbr->ibpqr", e, e, e) - np.einsum("jap,jaq,ibr->ibpqr", e, e, e)
    determinant = np.einsum("ijk,ip,jq,kr->pqr", _LEVI_CIVITA, *e.transpose(1, 0, 2))
    system = np.vstack((cubic.reshape(9, 64), determinant.reshape(1, 64))) @ _COLLAPSE
    reduced = -np.linalg.lstsq(system[:, :10], system[:, 10:], rcond=None)[0]
    times_x = np.array([reduced[i] if i < 10 else np.eye(10)[i - 10] for i in _TIMES_X])
    vectors = np.linalg.eig(times_x)[1].T
    last = vectors[:, 9]
    usable = np.abs(last) > 1e-12
    unknowns = vectors[usable, 6:9] / last[usable, None]
    real = np.abs(unknowns.imag).max(axis=1) <= _REAL * np.abs(unknowns).max(axis=1)
    coefficients = np.column_stack((unknowns[real].real, np.ones(int(real.sum()))))
    found = np.einsum("kp,pij->kij", coefficients, space)
    return np.asarray(found / np.linalg.norm(found, axis=(1, 2), keepdims=True))


def rotations_of(essential: Array) -> Array:
    """Both rotations of each essential matrix: (k, 3, 3) to (2 k, 3, 3); they differ by half a turn about the base."""
    left, _, right = np.linalg.svd(essential)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    both = np.concatenate((left @ quarter @ right, left @ quarter.T @ right))
    return np.asarray(both * np.sign(np.linalg.det(both))[:, None, None])
