"""Normal equations of a motion: block-tridiagonal in the pulses, with a border of parameters that all pulses share."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from rig.arrays import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Normals:
    """Normal equations of n pulses with s unknowns each and of b shared unknowns.

    Attributes:
        diagonal: (n, s, s).
        lower: (n - 1, s, s): block of row k + 1, column k.
        border: (n, s, b): pulses by shared unknowns.
        corner: (b, b).
        right: (n, s) right-hand side.
        right_corner: (b,).
    """

    diagonal: Floats
    lower: Floats
    border: Floats
    corner: Floats
    right: Floats
    right_corner: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """The solution of normal equations with the covariances that matter.

    Attributes:
        states: (n, s).
        shared: (b,).
        covariance: (n, s, s) of each pulse's unknowns.
        next_covariance: (n - 1, s, s) of those of pulses k and k + 1.
        shared_covariance: (b, b).
        cross: (n, s, b) covariance of pulses and shared unknowns.
        inverse: (n, s, s) inverses of the Cholesky factors L.
        coupling: (n - 1, s, s) L^-1 of the next pulse's block.
        response: (n, s, b): the change of the states by the shared unknowns is minus this.
    """

    states: Floats
    shared: Floats
    covariance: Floats
    next_covariance: Floats
    shared_covariance: Floats
    cross: Floats
    inverse: Floats
    coupling: Floats
    response: Floats

    def moved_by(self, by_states: Floats, by_shared: Floats) -> Floats:
        """Changes of the states (n, s, f) by f right-hand sides.

        Args:
            by_states: (n, s, f) right-hand sides of the equations of all pulses.
            by_shared: (b, f) of those of the shared unknowns.
        """
        alone = _back(self.inverse, self.coupling, _forward(self.inverse, self.coupling, by_states))
        pull = by_shared - np.einsum("nsb,nsf->bf", self.response, by_states)
        return np.asarray(alone - self.response @ (self.shared_covariance @ pull))

    def covariance_of(self, by_states: Floats, by_shared: Floats | None = None) -> Floats:
        """Covariance (f, f) of f linear functions.

        Args:
            by_states: (n, s, f) their derivatives by the states of all pulses.
            by_shared: (b, f) by the shared unknowns; none if left out.
        """
        f = by_states.shape[-1]
        reduced = _forward(self.inverse, self.coupling, by_states).reshape(-1, f)
        by_all = -self.response.reshape(-1, self.response.shape[-1]).T @ by_states.reshape(-1, f)
        if by_shared is not None:
            by_all += by_shared
        return np.asarray(reduced.T @ reduced + by_all.T @ self.shared_covariance @ by_all)


def solve(normals: Normals) -> Solution:
    """Solve by block Cholesky; covariances by selected inversion: only the blocks that the matrix itself has."""
    inverse, coupling = _factors(normals.diagonal, normals.lower)
    right = np.concatenate((normals.right[..., None], normals.border), axis=-1)
    both = _back(inverse, coupling, _forward(inverse, coupling, right))
    states, response = both[..., 0], both[..., 1:]
    reduced = normals.corner - np.einsum("nsb,nsc->bc", normals.border, response)
    shared_covariance = _inverted((reduced + reduced.T) / 2)
    shared = shared_covariance @ (normals.right_corner - np.einsum("nsb,ns->b", normals.border, states))
    states = states - response @ shared
    covariance, following = _selected_inverse(inverse, coupling)
    cross = -response @ shared_covariance
    covariance -= cross @ response.transpose(0, 2, 1)
    following -= cross[:-1] @ response[1:].transpose(0, 2, 1)
    return Solution(states, shared, covariance, following, shared_covariance, cross, inverse, coupling, response)


def _inverted(matrix: Floats) -> Floats:
    factor = np.linalg.cholesky(matrix)
    inverse = solve_triangular(factor, np.eye(len(factor)), lower=True, check_finite=False)
    return np.asarray(inverse.T @ inverse)


def _factors(diagonal: Floats, lower: Floats) -> tuple[Floats, Floats]:
    inverse, coupling = np.empty_like(diagonal), np.empty_like(lower)
    unit = np.eye(diagonal.shape[1])
    for k, block in enumerate(diagonal):
        left = block - coupling[k - 1].T @ coupling[k - 1] if k else block
        inverse[k] = solve_triangular(np.linalg.cholesky(left), unit, lower=True, check_finite=False)
        if k < len(lower):
            coupling[k] = inverse[k] @ lower[k].T
    return inverse, coupling


def _forward(inverse: Floats, coupling: Floats, right: Floats) -> Floats:
    out = np.empty_like(right)
    for k, part in enumerate(right):
        out[k] = inverse[k] @ (part - coupling[k - 1].T @ out[k - 1] if k else part)
    return out


def _back(inverse: Floats, coupling: Floats, reduced: Floats) -> Floats:
    out = np.empty_like(reduced)
    last = len(reduced) - 1
    for k in range(last, -1, -1):
        out[k] = inverse[k].T @ (reduced[k] - coupling[k] @ out[k + 1] if k < last else reduced[k])
    return out


def _selected_inverse(inverse: Floats, coupling: Floats) -> tuple[Floats, Floats]:
    covariance, following = np.empty_like(inverse), np.empty_like(coupling)
    covariance[-1] = inverse[-1].T @ inverse[-1]
    for k in range(len(inverse) - 2, -1, -1):
        gain = inverse[k].T @ coupling[k]
        following[k] = -gain @ covariance[k + 1]
        covariance[k] = inverse[k].T @ inverse[k] - following[k] @ gain.T
    return covariance, following
