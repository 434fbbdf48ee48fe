"""The step of the variances of lasting errors against the same in dense matrices."""

import numpy as np

from analysis.motion.adjustment.lasting_variances import Residuals, covariance_of, squares

RUNS, ERRORS, FREE = (3, 5, 4), 2, 60  # runs of each series, errors of a run, other residuals


def test_a_step_is_that_of_the_dense_formulas() -> None:
    rng = np.random.default_rng(8)
    size = ERRORS * sum(RUNS)
    rows = rng.standard_normal((size - 3, size))  # not all of them can be told from the residuals
    normal, pull = rows.T @ rows, rows.T @ rng.standard_normal(size - 3)
    residuals = Residuals.of(normal, pull, 100.0, float(FREE + size))
    assert residuals.rank == size - 3
    alike = [np.stack((np.exp(-np.abs(np.subtract.outer(range(w), range(w))) / 2), np.ones((w, w)))) for w in RUNS]
    variances, q = rng.uniform(0.1, 2.0, (len(RUNS), 2, ERRORS)), 1.3
    square, redundancy, better = squares(residuals, alike, variances, q)

    given, first = np.zeros((size, size)), 0
    derivatives = []  # of B by each variance
    for correlation, variance in zip(alike, variances, strict=True):
        own = slice(first, first := first + ERRORS * correlation.shape[-1])
        given[own, own] = covariance_of(correlation, variance)
        derivatives.append(np.zeros((2, ERRORS, size, size)))
        for kind in range(2):
            for error in range(ERRORS):
                part = np.kron(correlation[kind], np.diag(np.eye(ERRORS)[error]))
                derivatives[-1][kind, error][own, own] = part
    assert np.allclose(given, sum(np.einsum("ke,keab->ab", v, d) for v, d in zip(variances, derivatives, strict=True)))
    inverse = np.linalg.inv(q * np.eye(size) + normal @ given)
    g, weight = inverse @ pull, inverse @ normal
    assert np.allclose(square, variances**2 * [np.einsum("a,keab,b->ke", g, d, g) for d in derivatives])
    assert np.allclose(redundancy, variances * [np.einsum("keab,ba->ke", d, weight) for d in derivatives])
    unbent = residuals.errors @ inverse @ g
    free = q * np.trace(inverse) - (size - residuals.rank)
    expected = (residuals.square + q**2 * unbent + 1.0) / (residuals.redundancy + free + 1.0)
    assert np.isclose(better, expected)
