"""The stick model of Fig. 6: computes the angles that describe a jumper's pose from points and ski directions.

How this module reads the drawing, with X' the mean direction of the skis (tail to tip), O the midpoint of P3 and P4:

- alpha: between X' and the legs O-P2;
- beta: at the hip, between P2-O and P2-P1; 180 degrees would be a straight body;
- gamma: between the two skis, the opening of the V;
- dphi: slope of the right ski minus slope of the left one, above the horizontal;
- phi: slope of X' above the horizontal.
"""

import numpy as np

from photogrammetry.geometry.rotation import cross
from rig.arrays import Floats

#: Order of the angles.
ANGLES = ("alpha", "beta", "gamma", "dphi", "phi")


def body_angles(helmet: Floats, hip: Floats, origin: Floats, right: Floats, left: Floats) -> Floats:
    """The angles of poses.

    Args:
        helmet: P1 (..., 3), Z up.
        hip: P2 (..., 3).
        origin: O (..., 3).
        right: direction of the right ski (..., 3), tail to tip, of any length.
        left: of the left one.

    Returns:
        (..., 5) rad, in the order of `ANGLES`.
    """
    ahead = _unit(right) + _unit(left)
    one = np.stack((ahead, origin - hip, right), axis=-2)
    other = np.stack((hip - origin, helmet - hip, left), axis=-2)
    slopes = slope(np.stack((right, left, ahead), axis=-2))
    between = _between(one, other)
    return np.concatenate((between, slopes[..., :1] - slopes[..., 1:2], slopes[..., 2:]), axis=-1)


def body_angle_derivatives(helmet: Floats, hip: Floats, origin: Floats, right: Floats, left: Floats) -> Floats:
    """Derivatives (..., 5, 5, 3) of the angles by the five arguments of `body_angles`; zero where there is none."""
    skis = np.stack((right, left), axis=-2)
    length = np.linalg.norm(skis, axis=-1)[..., None]
    along = skis / length
    ahead = along.sum(axis=-2)
    one = np.stack((ahead, origin - hip, right), axis=-2)
    other = np.stack((hip - origin, helmet - hip, left), axis=-2)
    by_one, by_other = _between_gradients(one, other)
    steeper = slope_gradient(np.concatenate((skis, ahead[..., None, :]), axis=-2))
    by = np.zeros((*ahead.shape[:-1], len(ANGLES), 5, 3))
    by[..., 0, 1, :], by[..., 0, 2, :] = by_other[..., 0, :], -by_other[..., 0, :]
    by[..., 1, 0, :], by[..., 1, 2, :] = by_other[..., 1, :], by_one[..., 1, :]
    by[..., 1, 1, :] = -by_one[..., 1, :] - by_other[..., 1, :]
    by[..., 2, 3, :], by[..., 2, 4, :] = by_one[..., 2, :], by_other[..., 2, :]
    by[..., 3, 3, :], by[..., 3, 4, :] = steeper[..., 0, :], -steeper[..., 1, :]
    for angle, by_ahead in ((0, by_one[..., :1, :]), (4, steeper[..., 2:, :])):
        by[..., angle, 3:, :] = (by_ahead - (by_ahead * along).sum(axis=-1, keepdims=True) * along) / length
    return by


def slope(direction: Floats) -> Floats:
    """Angle of directions (..., 3) above the horizontal, rad."""
    return np.asarray(np.arctan2(direction[..., 2], np.hypot(direction[..., 0], direction[..., 1])))


def slope_gradient(direction: Floats) -> Floats:
    """Derivatives (..., 3) of `slope` by the direction; zero where there is none."""
    x, y, z = direction[..., 0], direction[..., 1], direction[..., 2]
    level = np.hypot(x, y)
    square = level**2 + z**2
    steep = _divided(z, level * square)
    out = np.empty_like(direction)
    out[..., 0], out[..., 1], out[..., 2] = -x * steep, -y * steep, _divided(level, square)
    return out


def slope_and_heading(direction: Floats) -> Floats:
    """Slope above the horizontal, and heading from X towards Y, of directions (..., 3): (..., 2) rad."""
    return np.stack((slope(direction), np.arctan2(direction[..., 1], direction[..., 0])), axis=-1)


def direction_of(angles: Floats) -> Floats:
    """Unit vectors (..., 3) of slope and heading (..., 2), rad; the inverse of `slope_and_heading`."""
    up, aside = angles[..., 0], angles[..., 1]
    return np.stack((np.cos(up) * np.cos(aside), np.cos(up) * np.sin(aside), np.sin(up)), axis=-1)


def by_slope_and_heading(direction: Floats) -> Floats:
    """Derivatives (n, 3, 2) of unit vectors (n, 3) by slope and heading, per rad."""
    x, y, z = direction.T
    level = np.hypot(x, y)
    nothing = np.zeros_like(x)
    return np.stack((np.stack((-z * x / level, -z * y / level, level)), np.stack((-y, x, nothing)))).transpose(2, 1, 0)


def _unit(direction: Floats) -> Floats:
    return np.asarray(direction / np.linalg.norm(direction, axis=-1, keepdims=True))


def _between(one: Floats, other: Floats) -> Floats:
    """Angle between vectors (..., 3), rad; precise also for small angles."""
    across = np.linalg.norm(cross(one, other), axis=-1)
    return np.asarray(np.arctan2(across, np.sum(one * other, axis=-1)))


def _between_gradients(one: Floats, other: Floats) -> tuple[Floats, Floats]:
    """Derivatives (..., 3) of `_between` by both vectors; zero where they are parallel.

    With n the unit vector across both, the angle grows as the one turns backwards about n, and the other forwards.
    """
    normal = cross(one, other)
    normal = _divided(normal, np.linalg.norm(normal, axis=-1, keepdims=True))
    by_one, by_other = (
        _divided(cross(normal, vector), np.sum(vector * vector, axis=-1, keepdims=True)) for vector in (one, other)
    )
    return -by_one, by_other


def _divided(numerator: Floats, by: Floats) -> Floats:
    """The quotient; 0 where the divisor is 0."""
    return np.asarray(np.where(by > 0, numerator, 0.0) / np.where(by > 0, by, 1.0))
