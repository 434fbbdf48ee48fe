"""The stick model of Fig. 6: computes the angles that describe a jumper's pose from points and ski directions.

How this module reads the drawing, with X' the mean direction of the skis (tail to tip), O the midpoint of P3 and P4:

- alpha: between X' and the legs O-P2;
- beta: at the hip, between P2-O and P2-P1; 180 degrees would be a straight body;
- gamma: between the two skis, the opening of the V;
- dphi: slope of the right ski minus slope of the left one, above the horizontal;
- phi: slope of X' above the horizontal.
"""

import numpy as np

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
    forward = _unit(right) + _unit(left)
    return np.stack(
        (
            _between(forward, hip - origin),
            _between(origin - hip, helmet - hip),
            _between(right, left),
            slope(right) - slope(left),
            slope(forward),
        ),
        axis=-1,
    )


def body_angle_derivatives(helmet: Floats, hip: Floats, origin: Floats, right: Floats, left: Floats) -> Floats:
    """Derivatives (..., 5, 5, 3) of the angles by the five arguments of `body_angles`; zero where there is none."""
    ahead = _unit(right) + _unit(left)
    by = np.zeros((*np.shape(helmet)[:-1], len(ANGLES), 5, 3))
    by_ahead, by_legs = _between_gradients(ahead, hip - origin)
    by[..., 0, 1, :], by[..., 0, 2, :] = by_legs, -by_legs
    by_thigh, by_back = _between_gradients(origin - hip, helmet - hip)
    by[..., 1, 0, :], by[..., 1, 1, :], by[..., 1, 2, :] = by_back, -by_thigh - by_back, by_thigh
    by[..., 2, 3, :], by[..., 2, 4, :] = _between_gradients(right, left)
    by[..., 3, 3, :], by[..., 3, 4, :] = slope_gradient(right), -slope_gradient(left)
    of_mean = np.stack((by_ahead, slope_gradient(ahead)), axis=-2)
    for ski, direction in ((3, right), (4, left)):
        along = _unit(direction)
        across = of_mean - (of_mean @ along[..., None]) * along[..., None, :]
        by[..., (0, 4), ski, :] = across / np.linalg.norm(direction, axis=-1)[..., None, None]
    return by


def slope(direction: Floats) -> Floats:
    """Angle of directions (..., 3) above the horizontal, rad."""
    return np.asarray(np.arctan2(direction[..., 2], np.hypot(direction[..., 0], direction[..., 1])))


def slope_gradient(direction: Floats) -> Floats:
    """Derivatives (..., 3) of `slope` by the direction; zero where there is none."""
    x, y, z = np.moveaxis(direction, -1, 0)
    level = np.hypot(x, y)
    square = level**2 + z**2
    steep = _divided(z, level * square)
    return np.stack((-x * steep, -y * steep, _divided(level, square)), axis=-1)


def slope_and_heading(direction: Floats) -> Floats:
    """Slope above the horizontal, and heading from X towards Y, of directions (..., 3): (..., 2) rad."""
    return np.stack((slope(direction), np.arctan2(direction[..., 1], direction[..., 0])), axis=-1)


def direction_of(angles: Floats) -> Floats:
    """Unit vectors (..., 3) of slope and heading (..., 2), rad; the inverse of `slope_and_heading`."""
    up, aside = angles[..., 0], angles[..., 1]
    return np.stack((np.cos(up) * np.cos(aside), np.cos(up) * np.sin(aside), np.sin(up)), axis=-1)


def _unit(direction: Floats) -> Floats:
    return np.asarray(direction / np.linalg.norm(direction, axis=-1, keepdims=True))


def _between(one: Floats, other: Floats) -> Floats:
    """Angle between vectors (..., 3), rad; precise also for small angles."""
    across = np.linalg.norm(_cross(one, other), axis=-1)
    return np.asarray(np.arctan2(across, np.sum(one * other, axis=-1)))


def _between_gradients(one: Floats, other: Floats) -> tuple[Floats, Floats]:
    """Derivatives (..., 3) of `_between` by both vectors; zero where they are parallel.

    With n the unit vector across both, the angle grows as the one turns backwards about n, and the other forwards.
    """
    normal = _cross(one, other)
    normal = _divided(normal, np.linalg.norm(normal, axis=-1, keepdims=True))
    by_one, by_other = (
        _divided(_cross(normal, vector), np.sum(vector * vector, axis=-1, keepdims=True)) for vector in (one, other)
    )
    return -by_one, by_other


def _cross(one: Floats, other: Floats) -> Floats:
    """As `np.cross`, which takes several times as long for a few vectors."""
    a, b, c = one[..., 0], one[..., 1], one[..., 2]
    x, y, z = other[..., 0], other[..., 1], other[..., 2]
    return np.stack((b * z - c * y, c * x - a * z, a * y - b * x), axis=-1)


def _divided(numerator: Floats, by: Floats) -> Floats:
    """The quotient; 0 where the divisor is 0."""
    return np.asarray(np.where(by > 0, numerator, 0.0) / np.where(by > 0, by, 1.0))
