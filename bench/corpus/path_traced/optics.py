"""Lens and movements of a camera: where in Blender's picture, which knows neither, a pixel of the image is."""

from typing import Final

import numpy as np

from rig.arrays import Floats
from simrig.world.conditions.camera_motion import CameraMotion
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario

FINER: Final = 2  #: pixels of a picture for one of the image, across
_TRIES: Final = 30  # until the distortion is undone
_SHAKE: Final = 6.0  # standard deviations of the camera's shake that the margin holds
_SPARE_PX: Final = 3


class Optics:
    """A camera of a scenario.

    Args:
        scenario: the scenario.
        index: of the camera in it.
        size: of the image, width and height, px.

    Attributes:
        camera: as it was set up.
        size: width and height of the picture, px of the picture.
    """

    def __init__(self, scenario: Scenario, index: int, size: tuple[int, int]) -> None:
        settings = scenario.cameras[index]
        self.camera, self._motion = settings.projection(*size), CameraMotion(scenario, index)
        self._ideal = _undistorted(self.camera)
        turn = np.radians(_SHAKE * settings.shake_deg + sum(np.linalg.norm(m.rotation_deg) for m in settings.moves))
        wider = np.abs(self._ideal).max(axis=(0, 1)) - np.array(size) / 2
        margin = int(np.ceil(max(0.0, *wider) + self.camera.c * turn)) + _SPARE_PX
        self.size = FINER * (size[0] + 2 * margin), FINER * (size[1] + 2 * margin)

    def pixels(self, points: Floats) -> Floats:
        """Where points (n, 3) are in the picture, px, (n, 2)."""
        return self._in_picture((points - self.camera.X0) @ self.camera.R)

    def places(self, scene_s: float) -> Floats:
        """Where in the picture the pixels of the image of scene time `scene_s` are, px, (rows, columns, 2)."""
        moved = self._motion.at(self.camera, scene_s)
        rays = np.concatenate((self._ideal, np.full((*self._ideal.shape[:2], 1), -self.camera.c)), axis=-1)
        return self._in_picture(rays @ (self.camera.R.T @ moved.R).T)

    def _in_picture(self, rays: Floats) -> Floats:
        """Where rays (..., 3) in the frame of the camera as it was set up meet the picture, px, (..., 2)."""
        ideal = -self.camera.c * FINER * rays[..., :2] / rays[..., 2:]
        width, height = self.size
        return np.stack(((width - 1) / 2 + ideal[..., 0], (height - 1) / 2 - ideal[..., 1]), axis=-1)


def _undistorted(camera: Projection) -> Floats:
    """Ideal metric image points of all pixels, px, (rows, columns, 2): the lens bends them into their pixels."""
    x, y = np.meshgrid(np.arange(camera.width, dtype=float), np.arange(camera.height, dtype=float))
    bent = np.stack((x - (camera.width - 1) / 2, (camera.height - 1) / 2 - y), axis=-1)
    if camera.lens is None:
        return bent
    reach = 0.75 * float(np.hypot(camera.width, camera.height))
    ideal = bent.copy()
    for _ in range(_TRIES):
        ideal += bent - camera.lens.bend(ideal, reach)
    return ideal
