"""Whether the Z axis of the survey points up: cameras are mounted upright, and a jumper falls.

Heights, slopes and the names of the points rest on Z being up, which no coordinate file says. Some cameras may be
mounted on their side, and a short flight may rise at its end; both together are not wrong by chance.
"""

from collections.abc import Iterable
from typing import Final

import numpy as np

from analysis.identification.over_time.flights import Flight
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Floats
from rig.errors import BadInputError

#: Upright cameras lean by less than this, and lift and drag turn the fall by less: half of the way to another axis.
_ASLANT_DEG: Final = 45.0
#: Acceleration across the path, m/s^2, that only gravity makes over a whole flight; lift leaves a third of it at least.
_FALLING_M_S2: Final = 3.0
_UP: Final = np.array((0.0, 0.0, 1.0))


def check_up(system: CameraSystem, flights: Iterable[Flight]) -> None:
    """Refuse a frame whose Z axis does not point up.

    Args:
        system: the oriented cameras.
        flights: of the recording, in that frame.

    Raises:
        BadInputError: the upper edges of the images and the fall of a jumper both point elsewhere.
    """
    cameras = _off(np.sum([camera.rotation[:, 1] for camera in system.cameras.values()], axis=0))
    falls = [_off(-across) for flight in flights if (across := _across(flight)) is not None]
    if cameras > _ASLANT_DEG and falls and min(falls) > _ASLANT_DEG:
        raise BadInputError(
            f"the Z axis of the survey does not point up: the images stand {cameras:.0f} degrees off it, and the "
            "jumper does not fall along it; write heights, upwards, as the third coordinate of a right-handed system"
        )


def _across(flight: Flight) -> Floats | None:
    """Acceleration (3,) across the path; None where it is too small to be gravity."""
    velocity, acceleration = flight.motion[1], flight.motion[2]
    across = acceleration - (acceleration @ velocity) / (velocity @ velocity) * velocity
    return np.asarray(across) if np.linalg.norm(across) > _FALLING_M_S2 else None


def _off(direction: Floats) -> float:
    """Angle between a direction (3,) and Z, degrees."""
    return float(np.degrees(np.arccos(np.clip(direction @ _UP / np.linalg.norm(direction), -1.0, 1.0))))
