"""The size of lasting errors: variance components, estimated from the residuals of an adjustment."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular

from rig.arrays import Floats

_PSEUDO: Final = 1.0  # observations that variances count as before a jump tells them
_STEPS_MOST, _SETTLED = 12, 0.02  # of the iteration of variances, and the relative change that ends it
_RANK: Final = 1e-9  # of the greatest eigenvalue


def covariance_of(alike: Floats, variance: Floats) -> Floats:
    """(w f, w f) of the errors of w runs with variances (2, f), run by run."""
    w, f = alike.shape[-1], variance.shape[-1]
    return np.asarray(np.einsum("kvw,ke,ef->vewf", alike, variance, np.eye(f)).reshape(w * f, w * f))


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """What the residuals v say about lasting errors e of r runs in all.

    Attributes:
        normal: (r f, r f) N = E' W Qv W E, the normal equations of e when all other unknowns are eliminated.
        pull: (r f,) E' W v, their right-hand side p.
        errors: (r f,) e, if nothing but the residuals is known.
        rank: of N.
        square: v' W v - p' e, what lasting errors have no part in.
        redundancy: of it.
    """

    normal: Floats
    pull: Floats
    errors: Floats
    rank: int
    square: float
    redundancy: float

    @classmethod
    def of(cls, normal: Floats, pull: Floats, square: float, redundancy: float) -> "Residuals":
        """From v' W v and the redundancy of all residuals."""
        values, vectors = np.linalg.eigh(normal)
        use = values > _RANK * values[-1]
        vectors = vectors[:, use]
        errors = vectors @ ((vectors.T @ pull) / values[use])
        rank = int(use.sum())
        inside = max(square - float(pull @ errors), 0.0), max(redundancy - rank, 0.0)
        return cls(normal, pull, errors, rank, *inside)


def variances_of(residuals: Residuals, alike: list[Floats], start: Floats) -> Floats:
    """Variances (s, 2, f) of the errors of each series: restricted maximum likelihood with a prior.

    If independent errors have q times the variances that the weights say, and lasting ones B, variances times
    correlations C, the right-hand sides p have the covariance V = q N + N B N. Each variance gets its square sum over
    its redundancy: with g = N V^-1 p and G = N V^-1 N, s becomes s (g' C g) / tr(C G), and likewise q, of which the
    rest of the residuals knows, too. All series together come first, with `start` as one observation; then each for
    itself, with what all say as one observation.
    """
    pooled, independent = start, 1.0
    variances = np.tile(start, (len(alike), 1, 1))
    for alone in (False, True):
        for _ in range(_STEPS_MOST):
            before = variances
            square, redundancy, independent = squares(residuals, alike, variances, independent)
            if alone:
                variances = (square + _PSEUDO * pooled) / (redundancy + _PSEUDO)
            else:
                pooled = (square.sum(axis=0) + _PSEUDO * start) / (redundancy.sum(axis=0) + _PSEUDO)
                variances = np.tile(pooled, (len(alike), 1, 1))
            if np.allclose(variances, before, rtol=_SETTLED, atol=0.0):
                break
    return variances


def squares(
    residuals: Residuals, alike: list[Floats], variances: Floats, independent: float
) -> tuple[Floats, Floats, float]:
    """Square sums (s, 2, f) times the squares of the variances, redundancies times the variances, and a better q."""
    f, normal, q = variances.shape[-1], residuals.normal, independent
    sizes = [f * correlation.shape[-1] for correlation in alike]
    each = [slice(end - size, end) for size, end in zip(sizes, np.cumsum(sizes).tolist(), strict=True)]
    # With B = R R' and M = q I + R' N R: (q I + N B)^-1 = (I - N R M^-1 R') / q.
    root, by_root, inner = np.zeros_like(normal), np.empty_like(normal), np.empty_like(normal)
    for own, correlation, variance in zip(each, alike, variances, strict=True):
        root[own, own] = np.linalg.cholesky(covariance_of(correlation, variance))
        by_root[:, own] = normal[:, own] @ root[own, own]
    for own in each:
        inner[own] = root[own, own].T @ by_root[own]
    factor = np.linalg.cholesky(inner + q * np.eye(len(inner)))
    half = solve_triangular(factor, by_root.T, lower=True, check_finite=False)

    def divided(values: Floats) -> Floats:
        """(q I + N B)^-1 times some values."""
        within = solve_triangular(factor, root.T @ values, lower=True, check_finite=False)
        return np.asarray((values - half.T @ within) / q)

    pulled = divided(residuals.pull)
    square, redundancy = np.empty_like(variances), np.empty_like(variances)
    for i, (own, correlation) in enumerate(zip(each, alike, strict=True)):
        w = correlation.shape[-1]
        weight = ((normal[own, own] - half[:, own].T @ half[:, own]) / q).reshape(w, f, w, f)
        g = pulled[own].reshape(w, f)
        square[i] = np.einsum("kvw,ve,we->ke", correlation, g, g)
        redundancy[i] = np.einsum("kvw,vewe->ke", correlation, weight)
    square, redundancy = square * variances**2, redundancy * variances
    unbent, free = float(residuals.errors @ divided(pulled)), residuals.rank - float(redundancy.sum())
    better = (residuals.square + q**2 * unbent + _PSEUDO) / (residuals.redundancy + free + _PSEUDO)
    return square, redundancy, better
