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


def slope(direction: Floats) -> Floats:
    """Angle of directions (..., 3) above the horizontal, rad."""
    return np.asarray(np.arctan2(direction[..., 2], np.hypot(direction[..., 0], direction[..., 1])))


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
    across = np.linalg.norm(np.cross(one, other), axis=-1)
    return np.asarray(np.arctan2(across, np.sum(one * other, axis=-1)))
