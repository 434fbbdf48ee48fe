"""Motion blur: the instants of an exposure at which the jumper is drawn, to be averaged.

They lie symmetrically about the middle of the exposure, to which every position belongs.
"""

import math

import numpy as np

from simrig.world.jumper import Jump, Pose
from simrig.world.projection import Projection

_STEP_PX = 1.0  #: from instant to instant; lens and pixels blur more than that
_SHORTEST_PX = 0.2  #: a shorter way is not seen
_PARTS_MOST = 24


def poses(jump: Jump, time_s: float, exposure_s: float, projection: Projection) -> list[Pose]:
    """The poses of an exposure.

    Args:
        jump: the jump.
        time_s: middle of the exposure, since take-off.
        exposure_s: how long it lasts; 0: one instant.
        projection: decides how finely it is divided.
    """
    if not exposure_s:
        return [jump.pose(time_s)]
    ends = np.stack([jump.origin(time_s + half * exposure_s) for half in (-0.5, 0.5)])
    way = float(np.hypot(*np.diff(projection.pixels(ends), axis=0)[0]))
    count = 1 if way < _SHORTEST_PX else min(_PARTS_MOST, max(2, math.ceil(way / _STEP_PX)))
    return [jump.pose(time_s + exposure_s * ((k + 0.5) / count - 0.5)) for k in range(count)]
