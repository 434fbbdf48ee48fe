"""Normal equations of a motion: block-tridiagonal in the pulses, with a border of parameters that all pulses share."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dtrtri

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
        carried: (n - 1, s, s) what the next pulse's reduced right-hand side gets of that of a pulse.
        gain: (n - 1, s, s) what a pulse's unknowns get of those of the next.
        response: (n, s, b): the change of the states by the shared unknowns is minus this.
    """

    states: Floats
    shared: Floats
    covariance: Floats
    next_covariance: Floats
    shared_covariance: Floats
    cross: Floats
    inverse: Floats
    carried: Floats
    gain: Floats
    response: Floats

    def effects_of(self, by_states: Floats, by_shared: Floats) -> tuple[Floats, Floats, Floats]:
        """Changes of the states (n, s, f) and of the shared unknowns (b, f) by f right-hand sides.

        The third is the covariance (f, f) of these right-hand sides as linear functions of all unknowns.

        Args:
            by_states: (n, s, f) right-hand sides of the equations of all pulses.
            by_shared: (b, f) of those of the shared unknowns.
        """
        reduced, pull = self._reduced(by_states, by_shared)
        shared = self.shared_covariance @ pull
        moved = _back(self.inverse, self.gain, reduced) - self.response @ shared
        return np.asarray(moved), np.asarray(shared), self._covariance(reduced, pull)

    def covariance_of(self, by_states: Floats, by_shared: Floats | None = None) -> Floats:
        """Covariance (f, f) of f linear functions.

        Args:
            by_states: (n, s, f) their derivatives by the states of all pulses.
            by_shared: (b, f) by the shared unknowns; none if left out.
        """
        return self._covariance(*self._reduced(by_states, 0.0 if by_shared is None else by_shared))

    def _reduced(self, by_states: Floats, by_shared: Floats | float) -> tuple[Floats, Floats]:
        f = by_states.shape[-1]
        pull = by_shared - self.response.reshape(-1, self.response.shape[-1]).T @ by_states.reshape(-1, f)
        return _forward(self.inverse, self.carried, by_states), np.asarray(pull)

    def _covariance(self, reduced: Floats, pull: Floats) -> Floats:
        flat = reduced.reshape(-1, reduced.shape[-1])
        return np.asarray(flat.T @ flat + pull.T @ self.shared_covariance @ pull)


def solve(normals: Normals) -> Solution:
    """Solve by block Cholesky; covariances by selected inversion: only the blocks that the matrix itself has.

    Raises:
        LinAlgError: the normal equations are not positive definite.
    """
    inverse, coupling = _factors(normals.diagonal, normals.lower)
    carried, gain = inverse[1:] @ coupling.swapaxes(1, 2), inverse[:-1].swapaxes(1, 2) @ coupling
    right = np.concatenate((normals.right[..., None], normals.border), axis=-1)
    both = _back(inverse, gain, _forward(inverse, carried, right))
    states, response = both[..., 0], both[..., 1:]
    border = normals.border.reshape(-1, normals.border.shape[-1])
    reduced = normals.corner - border.T @ response.reshape(border.shape)
    shared_covariance = _inverted((reduced + reduced.T) / 2)
    shared = shared_covariance @ (normals.right_corner - border.T @ states.ravel())
    states = states - response @ shared
    covariance, following = _selected_inverse(inverse, gain)
    cross = -response @ shared_covariance
    covariance -= cross @ response.swapaxes(1, 2)
    following -= cross[:-1] @ response[1:].swapaxes(1, 2)
    return Solution(states, shared, covariance, following, shared_covariance, cross, inverse, carried, gain, response)


def _inverted(matrix: Floats) -> Floats:
    inverse = _inverse_factor(matrix)
    return np.asarray(inverse.T @ inverse)


def _inverse_factor(matrix: Floats) -> Floats:
    """The inverse of the Cholesky factor L."""
    factor, failed = dpotrf(matrix, lower=1)
    inverse, singular = dtrtri(factor, lower=1)
    if failed or singular:
        raise np.linalg.LinAlgError("normal equations are not positive definite")
    return np.asarray(inverse)


def _factors(diagonal: Floats, lower: Floats) -> tuple[Floats, Floats]:
    """Inverses of the factors L of all pulses, and L^-1 of the blocks that couple them with the next ones."""
    inverse, coupling = np.empty_like(diagonal), np.empty_like(lower)
    for k, block in enumerate(diagonal):
        inverse[k] = _inverse_factor(block - coupling[k - 1].T @ coupling[k - 1] if k else block)
        if k < len(lower):
            np.matmul(inverse[k], lower[k].T, out=coupling[k])
    return inverse, coupling


def _forward(inverse: Floats, carried: Floats, right: Floats) -> Floats:
    out = np.asarray(inverse @ right)
    for k, by_last in enumerate(carried, start=1):
        out[k] -= by_last @ out[k - 1]
    return out


def _back(inverse: Floats, gain: Floats, reduced: Floats) -> Floats:
    out = np.asarray(inverse.swapaxes(1, 2) @ reduced)
    for k in range(len(gain) - 1, -1, -1):
        out[k] -= gain[k] @ out[k + 1]
    return out


def _selected_inverse(inverse: Floats, gain: Floats) -> tuple[Floats, Floats]:
    covariance, following = np.asarray(inverse.swapaxes(1, 2) @ inverse), np.empty_like(gain)
    for k in range(len(gain) - 1, -1, -1):
        np.matmul(-gain[k], covariance[k + 1], out=following[k])
        covariance[k] -= following[k] @ gain[k].T
    return covariance, following
