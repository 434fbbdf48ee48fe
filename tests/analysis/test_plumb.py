"""A survey whose Z axis does not point up is refused, and no other."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.identification.over_time.flights import Flight
from analysis.procedure.plumb import check_up
from analysis.scene.camera_system import CameraSystem
from photogrammetry.geometry.rotation import rotation_from_vector
from rig.arrays import Floats
from rig.errors import BadInputError
from tests.analysis.simulated import true_cameras


def flight(acceleration: tuple[float, float, float], turn: Floats) -> Flight:
    """The path of a jumper in a frame that is turned against one with Z up."""
    motion = np.array(((5.0, 0.0, -2.0), (25.0, 0.0, -6.0), acceleration)) @ turn.T
    return Flight(0.0, 1.2, 0.6, motion, np.eye(3), ())


def cameras(turn: Floats) -> CameraSystem:
    """The true cameras in that frame."""
    placed = true_cameras()
    turned = {name: replace(camera, rotation=turn @ camera.rotation) for name, camera in placed.cameras.items()}
    return replace(placed, cameras=turned)


FALL = (-2.0, 0.1, -5.5)
UPRIGHT = np.eye(3)
ON_ITS_SIDE, UPSIDE_DOWN = (rotation_from_vector(np.array((angle, 0.0, 0.0))) for angle in (np.pi / 2, np.pi))


@pytest.mark.parametrize("turn", [ON_ITS_SIDE, UPSIDE_DOWN], ids=["Y up", "Z down"])
def test_z_that_is_not_up_is_refused(turn: Floats) -> None:
    with pytest.raises(BadInputError, match=r"the Z axis of the survey does not point up: .*; write heights, upwards"):
        check_up(cameras(turn), [flight(FALL, turn)])


def test_cameras_may_hang_and_flights_may_rise() -> None:
    check_up(cameras(UPRIGHT), [flight(FALL, UPRIGHT)])
    check_up(cameras(UPSIDE_DOWN), [flight(FALL, UPRIGHT)])  # they hang, and Z is up all the same
    check_up(cameras(UPSIDE_DOWN), [flight((-2.0, 0.0, 0.5), UPRIGHT)])  # nothing tells where down is
    check_up(cameras(UPRIGHT), [flight((-2.0, 0.0, 6.0), UPRIGHT)])  # the legs straighten, then the sight ends
    check_up(cameras(UPRIGHT), [])
