"""Poses from three points and their rays, for very many triples of rays at once (Grunert's quartic, in closed form).

The same equations as `photogrammetry.start_values.resection`, which takes one triple and refines it; here hundreds of
thousands of hypotheses are computed, most of them wrong, so they are neither refined nor judged.
"""

import numpy as np
from numpy.typing import NDArray

from photogrammetry.geometry.rotation import cross
from rig.arrays import Floats, Integers

_Complex = NDArray[np.complex128]
_NEARLY_REAL = 0.1  # imaginary part of a root over its modulus: noise pushes double roots off the real axis


def poses_from_three_points(points: Floats, rays: Floats) -> tuple[Floats, Floats, Integers]:
    """Poses in which three object points lie on three rays.

    Args:
        points: (n, 3, 3) triples of object points, not on a line; or (1, 3, 3), the same for all.
        rays: (n, 3, 3) triples of unit rays in the camera system; or (1, 3, 3).

    Returns:
        Projection centres (m, 3), rotations (m, 3, 3) with columns r1, r2, r3, and to which triple each belongs (m,).
    """
    with np.errstate(all="ignore"):
        distances, triple = _distances(points, rays)
    in_camera = _of(rays, triple) * distances[:, :, None]
    rotation = _of(_frames(points), triple) @ _frames(in_camera).transpose(0, 2, 1)
    position = _of(points[:, 0], triple) - (rotation @ in_camera[:, 0, :, None])[:, :, 0]
    sound = np.isfinite(position).all(axis=1) & np.isfinite(rotation).all(axis=(1, 2))
    return position[sound], rotation[sound], triple[sound]


def _of(values: Floats, triple: Integers) -> Floats:
    """The values (n, ...) of these triples; or (1, ...), those of all."""
    return values if len(values) == 1 else values[triple]


def _distances(points: Floats, rays: Floats) -> tuple[Floats, Integers]:
    """Distances (m, 3) from the projection centre, and the triple of each solution."""
    a, b, c = (((points[:, i] - points[:, j]) ** 2).sum(axis=1) for i, j in ((1, 2), (0, 2), (0, 1)))
    cos_a, cos_b, cos_c = (np.einsum("ni,ni->n", rays[:, i], rays[:, j]) for i, j in ((1, 2), (0, 2), (0, 1)))
    p, q, s, t = (a - c) / b, (a + c) / b, c / b, a / b
    coefficients = np.stack(
        np.broadcast_arrays(
            (p - 1) ** 2 - 4 * s * cos_a**2,
            4 * (p * (1 - p) * cos_b - (1 - q) * cos_a * cos_c + 2 * s * cos_a**2 * cos_b),
            2 * (p**2 - 1 + 2 * (p * cos_b) ** 2 + 2 * (1 - s) * cos_a**2 - 4 * q * cos_a * cos_b * cos_c)
            + 4 * (1 - t) * cos_c**2,
            4 * (-p * (1 + p) * cos_b + 2 * t * cos_c**2 * cos_b - (1 - q) * cos_a * cos_c),
            (1 + p) ** 2 - 4 * t * cos_c**2,
        ),
        axis=1,
    )
    roots = _quartic_roots(coefficients)
    v = roots.real
    square, divisor = 1 + v * v - 2 * v * cos_b[:, None], 2 * (cos_c[:, None] - v * cos_a[:, None])
    u = ((p - 1)[:, None] * v * v - 2 * (p * cos_b)[:, None] * v + (1 + p)[:, None]) / divisor
    first = np.sqrt(b[:, None] / square)
    real = np.abs(roots.imag) <= _NEARLY_REAL * np.abs(roots)
    good = real & (v > 0) & (u > 0) & np.isfinite(first) & np.isfinite(u)
    triple, root = np.nonzero(good)
    chosen = first[triple, root]
    return np.stack((chosen, chosen * u[triple, root], chosen * v[triple, root]), axis=1), triple


def _quartic_roots(coefficients: Floats) -> _Complex:
    """All roots (n, 4) of quartics (n, 5), highest power first (Ferrari), with two steps of Newton's method."""
    e4, e3, e2, e1, e0 = coefficients.T.astype(complex)
    b, c, d, e = e3 / e4, e2 / e4, e1 / e4, e0 / e4
    # depressed: y^4 + f y^2 + g y + h
    f = c - 3 * b * b / 8
    g = d + b**3 / 8 - b * c / 2
    h = e - 3 * b**4 / 256 + b * b * c / 16 - b * d / 4
    # resolvent cubic z^3 + 2 f z^2 + (f^2 - 4 h) z - g^2 = 0: a root that is not zero
    d0 = (2 * f) ** 2 - 3 * (f * f - 4 * h)
    d1 = 2 * (2 * f) ** 3 - 9 * (2 * f) * (f * f - 4 * h) - 27 * g * g
    root = np.sqrt(d1 * d1 - 4 * d0**3)
    cube = np.where(np.abs(d1 + root) > np.abs(d1 - root), (d1 + root) / 2, (d1 - root) / 2) ** (1 / 3)
    turns = np.exp(2j * np.pi * np.arange(3) / 3)[:, None]
    cubes = cube * turns
    z = -(2 * f + cubes + d0 / np.where(cubes == 0, 1, cubes)) / 3
    z = np.take_along_axis(z, np.abs(z).argmax(axis=0)[None], axis=0)[0]
    w = np.sqrt(z)
    twist = g / np.where(w == 0, 1, w)
    roots = []
    for sign in (1, -1):
        inner = np.sqrt(-(z + 2 * f + sign * 2 * twist))
        roots += [(sign * w + inner) / 2, (sign * w - inner) / 2]
    found = np.stack(roots, axis=1) - (b / 4)[:, None]
    k = coefficients.astype(complex)
    for _ in range(2):
        value = (((k[:, :1] * found + k[:, 1:2]) * found + k[:, 2:3]) * found + k[:, 3:4]) * found + k[:, 4:5]
        slope = ((4 * k[:, :1] * found + 3 * k[:, 1:2]) * found + 2 * k[:, 2:3]) * found + k[:, 3:4]
        step = value / slope
        found = np.where(np.isfinite(step), found - step, found)
    return np.asarray(found, complex)


def _frames(points: Floats) -> Floats:
    """Orthonormal frames (n, 3, 3), columns, of triangles (n, 3, 3)."""
    first = points[:, 1] - points[:, 0]
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    third = cross(first, points[:, 2] - points[:, 0])
    third = third / np.linalg.norm(third, axis=1, keepdims=True)
    return np.asarray(np.stack((first, cross(third, first), third), axis=2))
