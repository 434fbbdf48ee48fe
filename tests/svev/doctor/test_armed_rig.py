"""What *Check* says of the cameras of an armed rig: the same as the live view."""

from datetime import UTC, datetime

import pytest

from rig.api.recordings import NextJumper
from rig.api.status import CameraState, CameraStatus, DiskStatus, PrerollStatus, PulseStatus, State, Status, TapGuard
from rig.phrase import NOTHING
from service.status.statements import about_camera, about_state
from svev.doctor.finding import Finding, Level
from svev.serving.panel_doctor import look_at_armed_cameras
from tests.support.rigs import SIM

NAMES = [camera.name for camera in SIM.cameras]


def _found(
    states: list[CameraState], overloaded: tuple[int, ...], *, idle: bool, running: bool = True
) -> list[Finding]:
    cameras = tuple(
        CameraStatus(
            name=camera.name, backend="sim", address="", state=state,
            statement=about_camera(camera, state, NOTHING, overloaded=bool(overloaded), idle=idle),
        )
        for camera, state in zip(SIM.cameras, states, strict=True)
    )  # fmt: skip
    status = Status(
        state=State.ARMED, since=datetime.now(UTC), guard=TapGuard(number=1, hold_s=0, confirm_s=0), rig="", version="",
        statement=about_state(State.ARMED, SIM.cameras, states, True, 30.0, overloaded), cameras=cameras,
        pulses=PulseStatus(arriving=True, running=running), preroll=PrerollStatus(seconds=0, limit_s=0, memory_mb=0),
        disk=DiskStatus(free_gb=1, reserve_gb=1, seconds_left=1, jumps_left=1, jump_s=1), recording=None,
        last_recording=None, next_jumper=NextJumper(), processes=(),
    )  # fmt: skip
    return list(look_at_armed_cameras(status))


def test_a_slow_computer_is_named_and_no_cable() -> None:
    found = _found([CameraState.SILENT, CameraState.READY, CameraState.SILENT], (0, 2), idle=False)
    assert "this computer is too slow" in found[0].what
    assert [each.level for each in found] == [Level.WARN, Level.WARN, Level.PASS, Level.WARN]
    assert not [each for each in found if "cable" in each.what + each.remedy]


@pytest.mark.parametrize(("running", "level"), [(True, Level.WARN), (False, Level.PASS)])
def test_a_camera_without_frames_is_not_good_unless_the_pulses_are_stopped(running: bool, level: Level) -> None:
    found = _found([CameraState.READY] * 3, (), idle=True, running=running)
    assert [each.level for each in found] == [level] * 3
    assert all("no frames come" in each.what for each in found)
