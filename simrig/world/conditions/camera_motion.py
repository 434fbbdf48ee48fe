"""Movements of a camera that should stand still: shake by the wind, slow drift, a knock."""

import math
from dataclasses import replace

import numpy as np

from rig.arrays import Floats
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario

_WAVES = 3  #: sine waves that make up the shake about each axis
_SHAKE_HZ = (2.0, 11.0)
_ROLL_SHARE = 0.5  #: the mast twists less than it bends


class CameraMotion:
    """Pose of one camera at any time; seeded.

    Args:
        scenario: the scenario.
        camera: index of the camera in it.

    Attributes:
        still: whether the camera never moves.
    """

    def __init__(self, scenario: Scenario, camera: int) -> None:
        settings = scenario.cameras[camera]
        self._moves = settings.moves
        self.still = not settings.moves and not settings.shake_deg
        rng = np.random.default_rng((scenario.seed, camera, 55))
        self._rates = 2 * math.pi * rng.uniform(*_SHAKE_HZ, (3, _WAVES))
        self._phases = rng.uniform(0, 2 * math.pi, (3, _WAVES))
        rms = np.radians(settings.shake_deg) * np.array((1.0, 1.0, _ROLL_SHARE))
        self._amplitudes = (rms * math.sqrt(2 / _WAVES))[:, None]

    def at(self, projection: Projection, scene_s: float) -> Projection:
        """`projection`, the camera as it was set up, in its pose at scene time `scene_s`."""
        if self.still:
            return projection
        turn = (self._amplitudes * np.sin(self._rates * scene_s + self._phases)).sum(axis=1)
        shift = np.zeros(3)
        for move in self._moves:
            end = move.from_s if move.until_s is None else move.until_s
            done = float(scene_s >= end) if end == move.from_s else (scene_s - move.from_s) / (end - move.from_s)
            share = min(max(done, 0.0), 1.0)
            turn = turn + share * np.radians(move.rotation_deg)
            shift += share * np.array(move.shift_m)
        return replace(projection, X0=projection.X0 + shift, R=projection.R @ _rotation(turn))


def _rotation(turn: Floats) -> Floats:
    """Rotation matrix of a rotation vector, rad, shape (3,) (Rodrigues)."""
    angle = float(np.linalg.norm(turn))
    if angle == 0:
        return np.eye(3)
    x, y, z = turn / angle
    cross = np.array(((0, -z, y), (z, 0, -x), (-y, x, 0)))
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)
