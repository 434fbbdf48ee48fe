"""Schemathesis makes up requests from the description of the API, right ones and wrong ones, and judges the answers."""

import subprocess
import sys
from pathlib import Path

import pytest

from rig.frame import FrameStatus
from tests.recorder.logs import ALL_OK
from tests.service.serving import serving
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel

pytestmark = pytest.mark.long

K2_LOST = (FrameStatus.OK, FrameStatus.LOST, FrameStatus.OK)
#: These answers have no end; they are tested on their own.
ENDLESS = (
    "/api/events",
    "/api/preview.mjpg",
    "/api/recordings/{recording_id}/digitizing/sessions/{operator}/changes",
)
#: No schema says which tables are right, which bytes are sound, which jumps can be compared, and which clicks meet.
UNDESCRIBED = (
    "import_start_list", "preview_start_list", "add_voice_note", "compare_spans", "compare_jumps", "do_action",
    "measure_length", "compare_operators", "import_marks",
    "refine_place", "track_things",
)  # fmt: skip


def schemathesis(url: str, folder: Path, *options: str) -> str:
    """Run it against a server; what it says, which ends in what it has found."""
    excluded = [f"--exclude-path={path}" for path in ENDLESS]
    command = [
        str(Path(sys.executable).with_name("st")), "run", f"{url}/openapi.json",
        "--seed=1", "--request-timeout=20", "--continue-on-failure", "--generation-database=none", *excluded,
        *(f"--exclude-operation-id={name}" for name in UNDESCRIBED), *options,
    ]  # fmt: skip
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=170, check=False)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr
    return done.stdout


def test_the_api_is_as_it_is_described(
    panel: Panel, service: MemoryService, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in ("webpanel.previews", "webpanel.routes.preview"):
        monkeypatch.setattr(f"{module}.WAIT_S", 0.01)  # a disarmed rig has no picture to wait for
    for number in range(3):
        write_recording(service.catalogue.directory, f"jump-{number}", (ALL_OK, K2_LOST, ALL_OK))
    service.arm()
    said = schemathesis(panel.url, tmp_path, "--phases=coverage,fuzzing", "--max-examples=8")
    assert "99 selected / 113 total" in said
    assert service.healthy()


def test_the_whole_service_is_as_it_is_described(tmp_path: Path, loopback: Loopback) -> None:
    with serving(tmp_path, write_rig(tmp_path, loopback, backend="sim"), loopback) as service:
        service.arm()
        for _ in range(2):
            recording = service.post("/api/recordings", {"duration_s": 60})["id"]
            service.await_pulses(3)  # of a log without any pulse nothing can be asked
            service.post(f"/api/recordings/{recording}/stop")
            service.await_state("armed")
        schemathesis(service.url, tmp_path, "--phases=examples,fuzzing", "--max-examples=5")
        service.get("/api/status")
