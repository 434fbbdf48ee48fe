"""The block solver against dense matrices."""

import numpy as np

from analysis.motion.adjustment.blocks import Normals, solve

N, S, B = 5, 4, 3


def test_solution_and_covariances_are_those_of_the_dense_inverse() -> None:
    rng = np.random.default_rng(3)
    rows = rng.standard_normal((200, N * S + B))
    for i in range(200):  # an observation sees two neighbouring pulses at most
        k = i % N
        rows[i, : max(k - 1, 0) * S] = rows[i, (k + 1) * S : N * S] = 0.0
    whole = rows.T @ rows
    right = rng.standard_normal(N * S + B)
    blocks = whole[: N * S, : N * S].reshape(N, S, N, S)
    found = solve(
        Normals(
            np.stack([blocks[k, :, k] for k in range(N)]),
            np.stack([blocks[k + 1, :, k] for k in range(N - 1)]),
            whole[: N * S, N * S :].reshape(N, S, B),
            whole[N * S :, N * S :],
            right[: N * S].reshape(N, S),
            right[N * S :],
        )
    )
    inverse, unknowns = np.linalg.inv(whole), np.linalg.solve(whole, right)
    own = inverse[: N * S, : N * S].reshape(N, S, N, S)
    assert np.allclose(found.states.ravel(), unknowns[: N * S])
    assert np.allclose(found.shared, unknowns[N * S :])
    assert np.allclose(found.shared_covariance, inverse[N * S :, N * S :])
    assert np.allclose(found.cross, inverse[: N * S, N * S :].reshape(N, S, B))
    assert np.allclose(found.covariance, np.stack([own[k, :, k] for k in range(N)]))
    assert np.allclose(found.next_covariance, np.stack([own[k, :, k + 1] for k in range(N - 1)]))
    functions = rng.standard_normal((N * S, 2))
    expected = functions.T @ inverse[: N * S, : N * S] @ functions
    assert np.allclose(found.covariance_of(functions.reshape(N, S, 2)), expected)
    other = rng.standard_normal((N * S + B, 2))
    moved, shared, spread = found.effects_of(other[: N * S].reshape(N, S, 2), other[N * S :])
    assert np.allclose(moved.reshape(N * S, 2), (inverse @ other)[: N * S])
    assert np.allclose(shared, (inverse @ other)[N * S :])
    assert np.allclose(spread, other.T @ inverse @ other)
