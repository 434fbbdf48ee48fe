r"""Cameras as other digitizers hold them: eleven coefficients of the direct linear transformation (DLT).

    u = (L1 X + L2 Y + L3 Z + L4) / (L9 X + L10 Y + L11 Z + 1),
    v = (L5 X + L6 Y + L7 Z + L8) / (L9 X + L10 Y + L11 Z + 1)

(Abdel-Aziz and Karara 1971; `dlt_inverse.m` of DLTdv). They hold interior and exterior orientation, but no distortion:
they are exact for points of which the lens' distortion was removed.
"""

from collections.abc import Mapping

import numpy as np

from analysis.scene.camera_system import CameraSystem, PlacedCamera
from photogrammetry.geometry.camera_model import distort
from photogrammetry.network.file import pixel_to_metric
from rig.arrays import Floats
from rig.errors import BadInputError

_MIRROR = np.array([1.0, -1.0])  # pixel frame to metric frame


def has_distortion(placed: PlacedCamera) -> bool:
    """Whether the lens shifts any point."""
    return bool(np.any(placed.camera.interior[3:]))


def undistorted(placed: PlacedCamera, xy: Floats) -> Floats:
    """Where points (..., 2), px, would be without distortion: principal distance and principal point stay."""
    return np.asarray((placed.reduced(xy) + placed.camera.interior[1:3]) * _MIRROR + (placed.size - 1) / 2)


def distorted(placed: PlacedCamera, xy: Floats) -> Floats:
    """The inverse of `undistorted`."""
    ideal = pixel_to_metric(xy, placed.size) - placed.camera.interior[1:3]
    return np.asarray(distort(placed.camera.lens(), ideal) * _MIRROR + (placed.size - 1) / 2, float)


def camera_matrix(placed: PlacedCamera) -> Floats:
    """(3, 3) from the camera's system (x right, y up, z backward) to the pixel frame, without distortion."""
    c, x0, y0 = placed.camera.interior[:3]
    cx, cy = (placed.size - 1) / 2 + np.array([x0, -y0])
    return np.array([[-c, 0.0, cx], [0.0, c, cy], [0.0, 0.0, 1.0]])


def coefficients(system: CameraSystem, matrices: Mapping[str, Floats]) -> Floats:
    """The coefficients of all cameras.

    Args:
        system: the m cameras.
        matrices: by camera, (3, 3) from its system to homogeneous image coordinates of the other program.

    Returns:
        (11, m).

    Raises:
        BadInputError: the origin of the object system lies beside a camera, in the plane through its centre across its
            axis; then the coefficients are not defined.
    """
    columns = []
    for name in system.names:
        placed = system[name]
        turned = placed.rotation.T
        whole = matrices[name] @ np.column_stack([turned, -turned @ placed.position])
        if abs(whole[2, 3]) <= 1e-9 * np.linalg.norm(placed.position):
            raise BadInputError(
                f"the origin of the survey lies just beside camera {name}, where DLT coefficients are not defined: "
                "shift the coordinates of the survey"
            )
        columns.append((whole / whole[2, 3]).ravel()[:11])
    return np.column_stack(columns)
