"""Closed solutions of the relative orientation from five points: essential matrices, their rotations and bases.

E = [b]x R satisfies u^T E v = 0 for each pair of rays, det E = 0 and 2 E E^T E = tr(E E^T) E. Five pairs leave four
matrices; the cubic constraints on their combination are ten equations in the twenty monomials of three unknowns. Solved
for the ten cubic monomials, they give the matrix of multiplication by the first unknown; its eigenvectors contain the
solutions, up to ten.
"""

from itertools import combinations_with_replacement, product

import numpy as np

from rig.arrays import Floats

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
_TINY = 1e-12
_REAL = 1e-6  # imaginary part over modulus below which an eigenvector is real


def essential_matrices(u: Floats, v: Floats) -> Floats:
    """Essential matrices of sets of homologous rays.

    Args:
        u: (s, n, 3) rays of the first image in its camera system, any length near 1; s sets of n >= 5.
        v: (s, n, 3) the same of the second image.

    Returns:
        (k, 3, 3) solutions of all sets, k <= 10 s, norm 1. With n > 5: of the four matrices that fit best.
    """
    rows = np.einsum("sni,snj->snij", u, v).reshape(len(u), -1, 9)
    e = np.linalg.svd(rows)[2][:, -4:].reshape(-1, 4, 3, 3).transpose(0, 2, 3, 1)
    square = np.einsum("siap,sjaq->sijpq", e, e)
    cubic = 2 * np.einsum("sijpq,sjbr->sibpqr", square, e) - np.einsum("sjjpq,sibr->sibpqr", square, e)
    minors = np.einsum("ijk,sjq,skr->siqr", _LEVI_CIVITA, e[:, 1], e[:, 2])
    determinant = np.einsum("sip,siqr->spqr", e[:, 0], minors)
    system = np.concatenate((cubic.reshape(-1, 9, 64), determinant.reshape(-1, 1, 64)), axis=1) @ _COLLAPSE
    reduced = -np.linalg.pinv(system[:, :, :10]) @ system[:, :, 10:]
    times_x = np.concatenate((reduced, np.broadcast_to(np.eye(10), reduced.shape)), axis=1)[:, _TIMES_X]
    vectors = np.linalg.eig(times_x)[1].transpose(0, 2, 1)
    finite = np.abs(vectors[..., 9]) > _TINY
    unknowns = vectors[..., 6:9] / np.where(finite, vectors[..., 9], 1.0)[..., None]
    real = finite & (np.abs(unknowns.imag).max(axis=2) <= _REAL * np.abs(unknowns).max(axis=2))
    found = np.einsum("skp,sijp->skij", unknowns.real, e[..., :3]) + e[:, None, :, :, 3]
    found = found[real]
    return np.asarray(found / np.linalg.norm(found, axis=(1, 2), keepdims=True))


def orientations_of(essential: Floats) -> tuple[Floats, Floats]:
    """Both rotations and the base of each essential matrix: (k, 3, 3) to (2 k, 3, 3) and (2 k, 3).

    The two rotations differ by half a turn about the base. The sign of the base is undetermined.
    """
    left, _, right = np.linalg.svd(essential)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    both = np.concatenate((left @ quarter @ right, left @ quarter.T @ right))
    return both * np.sign(np.linalg.det(both))[:, None, None], np.concatenate((left[..., 2], left[..., 2]))
