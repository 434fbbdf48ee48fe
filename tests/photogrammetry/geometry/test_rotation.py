"""Rotations: exponential, logarithm and their derivative at every angle, half turns included."""

import numpy as np
import pytest

from photogrammetry.geometry.rotation import (
    increment_jacobian,
    nearest_rotation,
    omega_phi_kappa,
    omega_phi_kappa_jacobian,
    rotation_from_vector,
    vector_from_rotation,
)
from rig.arrays import Floats


def _vectors(angle: float) -> Floats:
    directions: Floats = np.random.default_rng(3).normal(size=(50, 3))
    directions *= angle / np.linalg.norm(directions, axis=1, keepdims=True)
    return directions


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 0.3, 2.0, 3.14, np.pi - 1e-9])
def test_logarithm_inverts_exponential(angle: float) -> None:
    vectors = _vectors(angle)
    rotations = rotation_from_vector(vectors)
    assert np.abs(rotations @ np.swapaxes(rotations, 1, 2) - np.eye(3)).max() < 1e-14
    assert np.abs(vector_from_rotation(rotations) - vectors).max() < 1e-13


@pytest.mark.parametrize("angle", [1e-5, 0.3, 2.0, 3.0])
def test_increment_jacobian_against_central_differences(angle: float) -> None:
    vector, h = _vectors(angle)[0], 1e-6
    rotation = rotation_from_vector(vector)
    steps = np.eye(3) * h
    ahead, behind = (vector_from_rotation(rotation @ rotation_from_vector(sign * steps)) for sign in (1, -1))
    assert np.abs((ahead - behind).T / (2 * h) - increment_jacobian(vector)).max() < 1e-8


def test_nearest_rotation_is_orthonormal_and_near() -> None:
    rotations = rotation_from_vector(_vectors(1.0))
    rounded = np.round(rotations, 5)
    nearest = nearest_rotation(rounded)
    assert np.abs(nearest @ np.swapaxes(nearest, 1, 2) - np.eye(3)).max() < 1e-14
    assert np.abs(nearest - rotations).max() < 2e-5


def test_omega_phi_kappa_and_their_derivatives() -> None:
    """R_X(omega) R_Y(phi) R_Z(kappa) gives R again; the derivatives are those of central differences."""
    rotations, h = rotation_from_vector(np.concatenate((_vectors(1.2), _vectors(2.9)))), 1e-6
    angles = omega_phi_kappa(rotations)
    turns = [rotation_from_vector(angles[:, i : i + 1] * np.eye(3)[i]) for i in range(3)]
    assert np.abs(turns[0] @ turns[1] @ turns[2] - rotations).max() < 1e-14
    steps = rotation_from_vector(h * np.eye(3))
    ahead, behind = (omega_phi_kappa(rotations[:, None] @ turn) for turn in (steps, np.swapaxes(steps, 1, 2)))
    change = (ahead - behind + np.pi) % (2.0 * np.pi) - np.pi
    numeric = np.swapaxes(change, 1, 2) / (2.0 * h)
    assert np.abs(numeric - omega_phi_kappa_jacobian(angles)).max() < 1e-5 * np.abs(numeric).max()
