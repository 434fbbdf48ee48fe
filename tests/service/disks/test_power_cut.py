"""All processes end at once, as when the power goes: what is there after the next start."""

import os
import signal
from pathlib import Path

import pytest

from recorder.checking.verify import verify
from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long


def _told(service: Serving) -> list[str]:
    return [line for line in service.log.read_text().splitlines() if "recordings go to" in line]


def test_after_a_power_cut_the_service_is_armed_and_the_recording_is_there(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, loopback, backend="sim")
    with rig.open("a") as file:
        file.write("[service]\narm_at_start = true\n")
    with serving(tmp_path, rig, loopback, ends_with=-signal.SIGKILL) as service:
        service.await_state("armed")
        recording = service.post("/api/recordings", {"athlete": "Kari", "bib": "17"})["id"]
        service.await_pulses(60)
        for pid in (service.pid, *service.pids().values()):
            os.kill(pid, signal.SIGKILL)
        service.exit_code()

    with serving(tmp_path, rig, loopback) as service:
        service.await_state("armed")
        assert _told(service) == []
        (found,) = service.get("/api/recordings")
        assert (found["id"], found["session"]["athlete"]) == (recording, "Kari")
        report = verify(service.data / f"{recording}.mcap")
        assert report.closed is False
        assert report.ledger.counts().pulses >= 30, "at most the last second is missing"
        again = service.post("/api/recordings")["id"]
        service.await_pulses(5)
        service.post(f"/api/recordings/{again}/stop")
        assert verify(service.data / f"{again}.mcap").closed


def test_a_folder_that_overrides_that_of_the_rig_file_is_said(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, loopback, backend="sim")
    with rig.open("a") as file:
        file.write(f'[recorder]\ndirectory = "{tmp_path / "season"}"\n')
    with serving(tmp_path, rig, loopback) as service:
        wait_until(lambda: bool(_told(service)), "it is said where recordings go")
        (line,) = _told(service)
        assert f"to {tmp_path / 'data'} as --data says, not to {tmp_path / 'season'} as {rig} says" in line
        assert service.state() == "idle"
