"""Where a camera looks: the rotation that scenarios and planned networks describe by `X0`, `look_at` and `roll_deg`."""

import math

import numpy as np
from numpy.typing import ArrayLike

from rig.arrays import Floats


def look_at(X0: ArrayLike, target: ArrayLike, roll_deg: float = 0.0) -> Floats:  # noqa: N803
    """Rotation of a camera whose optical axis meets `target`.

    With `roll_deg` = 0 the rows of the image are horizontal. A positive roll turns the camera clockwise as seen from
    behind it, so the scene turns counter-clockwise in the image.

    Args:
        X0: (3,) projection centre, Z upwards.
        target: (3,) point on the optical axis; not straight above or below `X0`.
        roll_deg: turn about the optical axis.

    Returns:
        (3, 3), columns r1 (to the right), r2 (up), r3 (backwards, away from the target) of Eq. (A1).
    """
    back = np.asarray(X0, float) - np.asarray(target, float)
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    cos, sin = math.cos(math.radians(roll_deg)), math.sin(math.radians(roll_deg))
    return np.column_stack((cos * right - sin * up, sin * right + cos * up, back))
