"""`svev record` without a pulse generator: cameras are told to expose."""

import json
import shutil
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from rig.settings.file import load_rig
from tests.capture.rigs import write_rig
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.support.repeats import repeats
from tests.support.stamps import hill_pulses

_GVCP_PORT = 3956
FAKE_CAMERA = shutil.which("arv-fake-gv-camera-0.8")


def _record(rig: Path, out: Path, seconds: float) -> tuple[int, dict[str, Any], str]:
    length = ("--seconds", str(seconds))
    done = run_svev("record", "--rig", str(rig), *length, "--out", str(out), "--json", timeout_s=90)
    return done.returncode, json.loads(done.stdout) if done.stdout else {}, done.stderr


@pytest.mark.parametrize("backend", repeats(["aravis", "mixed"]))
def test_three_cameras_are_recorded_unmixed_and_their_spread_is_told(
    tmp_path: Path, loopback: Loopback, backend: str
) -> None:
    path = write_rig(tmp_path, backend, loopback, source="software", rate_hz=8.0)
    code, result, said = _record(path, tmp_path / "logs", 2)
    assert code in {0, 5}, said  # 5: the busy machine gave no camera a command in time
    assert result["alarms"] == []
    assert result["complete"] > result["pulses"] / 2
    assert result["causes"]["lost"] == 0
    shown = [len(pulses) for pulses in hill_pulses(Path(result["log"]), load_rig(path)).values()]
    assert max(shown) == 1, "frames of one exposure; of none where no camera was told in time"
    assert "trigger software trigger, frames of a pulse lie up to" in said


def test_cameras_that_do_not_keep_up_are_no_fault_of_a_generator(tmp_path: Path, loopback: Loopback) -> None:
    """K1 answers, but no frame of it arrives."""
    faults = [{"kind": "lost_frame", "camera": "K1", "at_pulse": pulse} for pulse in range(3000)]
    path = write_rig(tmp_path, "aravis", loopback, source="software", faults=faults, names=("K1",))
    path.write_text(path.read_text().replace("[trigger]\n", "[trigger]\nsettle_s = 0.5\n"))
    code, _, said = _record(path, tmp_path / "logs", 1)
    assert code == 5
    assert "lower trigger.rate_hz or exposure_us in the rig file" in said
    assert "generator" not in said


@contextmanager
def _fake_camera() -> Iterator[None]:
    """Aravis's own simulated camera, which takes the loopback interface's first address."""
    assert FAKE_CAMERA is not None
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("127.0.0.1", _GVCP_PORT))
        except OSError:
            pytest.skip("another program has port 3956 of 127.0.0.1, which Aravis's own camera needs")
    with subprocess.Popen([FAKE_CAMERA, "-i", "127.0.0.1"], stdout=subprocess.DEVNULL) as camera:
        try:
            yield
        finally:
            camera.terminate()
            camera.wait(10)


@pytest.mark.skipif(FAKE_CAMERA is None, reason="needs arv-fake-gv-camera-0.8: apt-get install aravis-tools")
def test_aravis_own_camera_whose_clock_cannot_be_read(tmp_path: Path, loopback: Loopback) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(
        f'name = "fake"\n[trigger]\nsource = "software"\nrate_hz = 5.0\n[network]\npublish = "{loopback.endpoint()}"\n'
        '[[cameras]]\nname = "K1"\nbackend = "aravis"\naddress = "127.0.0.1"\nexposure_us = 1000\n'
        "region = { width = 512, height = 512 }\n"
    )
    with _fake_camera():
        code, result, said = _record(path, tmp_path / "logs", 2)
    assert code in {0, 5}, said
    assert result["complete"] == result["pulses"] - result["partial"] > 5
    assert "its clock cannot be read: its frames have the times of the commands" in said
    assert "the camera is triggered by software: for set-up only" in said
