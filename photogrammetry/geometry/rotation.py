"""Rotations as 3x3 matrices with local increments: R' = R exp([d]x), d about the camera's own axes.

The columns of R are the camera's axes r1, r2, r3 in the object system (paper, appendix A). Local increments have no
singular attitude (gimbal lock). `sigma_angles` of results are the standard deviations of d.
"""

import numpy as np

from rig.arrays import Floats, Numbers

_SMALL = 1e-4  # rad; below it the power series are exact to the last bit


def skew(vectors: Numbers) -> Numbers:
    """Cross-product matrices (..., 3, 3) of vectors a (..., 3): [a]x b = a x b; complex numbers pass through."""
    vectors = np.asarray(vectors)
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    matrices = np.zeros((*vectors.shape, 3), dtype=vectors.dtype)
    matrices[..., 0, 1], matrices[..., 0, 2], matrices[..., 1, 2] = -z, y, -x
    matrices[..., 1, 0], matrices[..., 2, 0], matrices[..., 2, 1] = z, -y, x
    return matrices


def cross(one: Floats, other: Floats) -> Floats:
    """Cross products (..., 3): as `np.cross`, which takes several times as long for a few vectors."""
    a, b, c = one[..., 0], one[..., 1], one[..., 2]
    x, y, z = other[..., 0], other[..., 1], other[..., 2]
    out = np.empty(np.broadcast_shapes(one.shape, other.shape))
    out[..., 0], out[..., 1], out[..., 2] = b * z - c * y, c * x - a * z, a * y - b * x
    return out


def rotation_from_vector(vectors: Floats) -> Floats:
    """Rotation matrices (..., 3, 3) of rotation vectors (..., 3), rad (Rodrigues)."""
    vectors = np.asarray(vectors, dtype=float)
    angle = np.sqrt(np.sum(vectors * vectors, axis=-1))[..., None, None]
    across = skew(vectors)
    # np.sinc(x) is sin(pi x) / (pi x), and 1 at 0.
    rotation: Floats = np.eye(3) + np.sinc(angle / np.pi) * across
    rotation += 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * (across @ across)
    return rotation


def vector_from_rotation(rotations: Floats) -> Floats:
    """Rotation vectors (..., 3), rad, of length 0..pi: the inverse of `rotation_from_vector`."""
    # From the row of 4 q q^T with the largest diagonal element: accurate at every angle, pi included.
    r = np.asarray(rotations, dtype=float)
    diagonal = np.diagonal(r, axis1=-2, axis2=-1)
    trace = diagonal.sum(axis=-1)
    squares = np.concatenate([trace[..., None], diagonal], axis=-1)
    off = np.stack([r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], axis=-1)
    outer = r + np.swapaxes(r, -1, -2)
    full = np.empty((*trace.shape, 4, 4))  # 4 q q^T
    full[..., 0, 0] = 1.0 + trace
    full[..., 0, 1:] = full[..., 1:, 0] = off
    full[..., 1:, 1:] = outer + (1.0 - trace)[..., None, None] * np.eye(3)
    pick = np.argmax(squares, axis=-1)
    quaternion = np.take_along_axis(full, pick[..., None, None], axis=-2)[..., 0, :]
    quaternion = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    quaternion = np.where(quaternion[..., :1] < 0.0, -quaternion, quaternion)
    sine = np.linalg.norm(quaternion[..., 1:], axis=-1)
    angle = 2.0 * np.arctan2(sine, quaternion[..., 0])
    factor = np.where(sine < _SMALL, 2.0 / np.maximum(quaternion[..., 0], 0.5), angle / np.where(sine > 0.0, sine, 1.0))
    vector: Floats = factor[..., None] * quaternion[..., 1:]
    return vector


def increment_jacobian(vector: Floats) -> Floats:
    """Derivative (3, 3) of log(R exp([d]x)) by d at d = 0 (inverse right Jacobian), for vector (3,) = log(R)."""
    angle = float(np.linalg.norm(vector))
    across = skew(vector)
    second = 1.0 / 12.0
    if angle >= _SMALL:
        second = 1.0 / angle**2 - (1.0 + np.cos(angle)) / (2.0 * angle * np.sin(angle))
    jacobian: Floats = np.eye(3) + 0.5 * across + second * (across @ across)
    return jacobian


def omega_phi_kappa(rotations: Floats) -> Floats:
    """Angles omega, phi, kappa (..., 3), rad, of R = R_X(omega) R_Y(phi) R_Z(kappa); phi in -pi/2..pi/2."""
    r = np.asarray(rotations, dtype=float)
    omega = np.arctan2(-r[..., 1, 2], r[..., 2, 2])
    phi = np.arcsin(np.clip(r[..., 0, 2], -1.0, 1.0))
    kappa = np.arctan2(-r[..., 0, 1], r[..., 0, 0])
    return np.stack([omega, phi, kappa], axis=-1)


def omega_phi_kappa_jacobian(angles: Floats) -> Floats:
    """Derivatives (..., 3, 3) of omega, phi, kappa by the local increments d, at angles (..., 3), rad.

    Not finite at phi = +-pi/2, where omega and kappa turn about one axis.
    """
    _, phi, kappa = np.moveaxis(np.asarray(angles, dtype=float), -1, 0)
    jacobian = np.zeros((*phi.shape, 3, 3))
    with np.errstate(divide="ignore", invalid="ignore"):
        jacobian[..., 0, 0] = np.cos(kappa) / np.cos(phi)
        jacobian[..., 0, 1] = -np.sin(kappa) / np.cos(phi)
    jacobian[..., 1, 0], jacobian[..., 1, 1] = np.sin(kappa), np.cos(kappa)
    jacobian[..., 2, :2] = -np.sin(phi)[..., None] * jacobian[..., 0, :2]
    jacobian[..., 2, 2] = 1.0
    return jacobian


def nearest_rotation(matrix: Floats) -> Floats:
    """The rotations (..., 3, 3) nearest to matrices with positive determinant (Frobenius norm)."""
    left, _, right = np.linalg.svd(matrix)
    sign = np.linalg.det(left @ right)
    left = left.copy()
    left[..., :, 2] *= sign[..., None]
    nearest: Floats = left @ right
    return nearest
