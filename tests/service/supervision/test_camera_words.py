"""What is said of a camera."""

import pytest

from rig.api.statement import Level
from rig.api.status import CameraState
from rig.phrase import NOTHING
from service.status.statements import about_camera
from tests.support.rigs import SIM


@pytest.mark.parametrize(
    ("idle", "level", "code"), [(False, Level.GOOD, "camera_ready"), (True, Level.INFO, "camera_waits")]
)
def test_a_camera_that_sends_nothing_is_not_green(idle: bool, level: Level, code: str) -> None:
    said = about_camera(SIM.cameras[0], CameraState.READY, NOTHING, overloaded=False, idle=idle)
    assert (said.level, said.code) == (level, code)
