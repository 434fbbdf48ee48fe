"""A training with the real service: every log is measured by itself, also by a service that was killed meanwhile."""

import json
import signal
from pathlib import Path
from typing import Any

import pytest

from recorder.log.beside import measured_path
from service.measuring.waiting import NAME
from simrig.world.survey import survey
from tests.analysis.scene.hill import training
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, Serving, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

#: The measuring gets only the processor time that nobody else wants.
_MEASURED_S = 4 * PATIENCE_S
pytestmark = [pytest.mark.long, pytest.mark.alone, pytest.mark.timeout(3 * _MEASURED_S)]

#: A jump comes every 4 s; the balls want some seconds without a jumper.
_LENGTH_S = 9.0


def test_every_log_is_measured_by_itself_also_after_the_service_was_killed(tmp_path: Path, loopback: Loopback) -> None:
    rig, surveyed = write_rig(tmp_path, "sim", loopback), tmp_path / "survey.json"
    rig.write_text(rig.read_text() + '[analysis]\nsurvey = "survey.json"\n')
    surveyed.write_text(json.dumps(survey(training())))
    with serving(tmp_path, rig, loopback, ends_with=-signal.SIGKILL) as service:
        service.arm()
        both = _recorded(service, "17"), _recorded(service, "18")
        wait_until(lambda: service.get("/api/status")["measuring"]["step"] is not None, "one", PATIENCE_S, 0.05)
        measuring = service.get("/api/status")["measuring"]
        service.signal(signal.SIGKILL)
        service.exit_code()
        data = service.data
    assert measuring["recording"] in both
    assert measuring["waiting"] == 1, "the other one was recorded meanwhile"
    assert sorted(json.loads((data / NAME).read_text())) == sorted(both)
    assert not any(measured_path(data / f"{each}.mcap").exists() for each in both)
    with serving(tmp_path, rig, loopback) as service:
        for each in both:
            _await_measured(service, each)
        assert service.get("/api/status")["measuring"]["waiting"] == 0
        last = service.get("/api/status")["last_jump"]
        assert (last["recording"], last["live"]) == (both[1], False), service.log.read_text()
    assert json.loads((data / NAME).read_text()) == []


def _recorded(service: Serving, bib: str) -> str:
    order = {"preroll_s": 0.0, "duration_s": _LENGTH_S, "bib": bib}
    recording: str = service.post("/api/recordings", order)["id"]
    wait_until(lambda: service.state() == "armed", "the recording is over", PATIENCE_S, 0.05)
    return recording


def _await_measured(service: Serving, recording: str) -> None:
    found: dict[str, Any] = {}

    def done() -> bool:
        found.update(service.get(f"/api/recordings/{recording}/measurement"))
        return found["state"] in {"done", "failed"}

    wait_until(done, f"{recording} is measured", _MEASURED_S, 0.1)
    assert found["state"] == "done", found["problem"]
    assert not found["live"]
    assert found["jumps"]
    assert "report.html" in found["files"]
