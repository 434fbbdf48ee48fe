"""`svev record` with one command for all FireWire cameras: real libdc1394 on an emulated bus."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from recorder.reading.log_reader import LogReader
from rig.frame import FrameStatus
from rig.settings.file import load_rig
from rig.tag import TripletTag
from rig.topics import TAG
from tests.capture.rigs import write_rig
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.support.stamps import hill_pulses

pytestmark = pytest.mark.long

RATE_HZ = 8.0
CYCLE_US = 125.0


def _record(rig: Path, out: Path, seconds: float) -> tuple[int, dict[str, Any], str]:
    length = ("--seconds", str(seconds))
    done = run_svev("record", "--rig", str(rig), *length, "--out", str(out), "--json", timeout_s=90)
    return done.returncode, json.loads(done.stdout) if done.stdout else {}, done.stderr


def _tags(log: str) -> Sequence[TripletTag]:
    with LogReader(Path(log)) as reader:
        return [TripletTag.decode(message.data or b"") for message in reader.messages(TAG.name)]


def test_one_command_exposes_all_cameras_of_the_bus(tmp_path: Path, loopback: Loopback) -> None:
    path = write_rig(tmp_path, "iidc", loopback, source="iidc-broadcast", rate_hz=RATE_HZ)
    code, result, said = _record(path, tmp_path / "logs", 2)
    assert code in {0, 5}, said  # 5: the busy machine gave a command too late, or lost a frame
    assert code == 5 or result["alarms"] == []
    assert result["complete"] > result["pulses"] / 2
    assert "for set-up only" not in said
    tags = [tag for tag in _tags(result["log"]) if tag.complete]
    assert max(abs(camera.offset_us or 0.0) for tag in tags for camera in tag.cameras) < CYCLE_US
    assert {len(pulses) for pulses in hill_pulses(Path(result["log"]), load_rig(path)).values()} == {1}


def test_commands_go_on_when_the_camera_that_leads_to_the_bus_is_away(tmp_path: Path, loopback: Loopback) -> None:
    """K1, the first one, loses its power soon after the start."""
    faults = [{"kind": "restart", "camera": "K1", "at_pulse": 60, "duration_s": 60}]
    path = write_rig(tmp_path, "iidc", loopback, source="iidc-broadcast", rate_hz=RATE_HZ, faults=faults)
    path.write_text(path.read_text().replace("[trigger]\n", "[trigger]\nmin_cameras = 2\n"))
    code, result, said = _record(path, tmp_path / "logs", 8)
    assert code == 5, said
    fates = [[camera.status for camera in tag.cameras] for tag in _tags(result["log"])]
    assert fates[-1][0] is not FrameStatus.OK, said
    assert [FrameStatus.OK, FrameStatus.OK] in [fate[1:] for fate in fates[-3:]], said
