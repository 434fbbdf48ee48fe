"""A training without a touch: recordings begin when a jumper comes into sight, or at a mark from outside."""

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from recorder.checking.verify import verify
from tests.capture.rigs import write_rig
from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long

NAMES = ["Anna", "Berit", "Cecilie"]
AUTOMATIC = """
[automatic]
before_s = 1.0
after_s = 1.2
motion = { camera = "K1", region = { x = 40, y = 0, width = 600, height = 480 } }
"""


def _ended(service: Serving) -> list[dict[str, Any]]:
    """The recordings that have ended, oldest first."""
    recordings: list[dict[str, Any]] = service.get("/api/recordings")
    return [recording for recording in reversed(recordings) if recording["state"] == "finished"]


def _alarms(service: Serving) -> list[str]:
    """What may be unrecorded, of all alarms."""
    alarms = [alarm for alarm in service.get("/api/status")["alarms"] if alarm["topic"] == "unrecorded"]
    return [alarm["statement"]["code"] for alarm in alarms]


def test_jumpers_are_recorded_without_a_touch_and_marks_from_outside_too(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    rig.write_text(rig.read_text().replace("[[cameras]]", AUTOMATIC + "[[cameras]]", 1))
    with serving(tmp_path, rig, loopback) as service:
        service.call_table(b"bib;athlete\n1;Anna\n2;Berit\n3;Cecilie\n4;Dina\n")
        assert service.arm()["automatic"] == {"on": True, "camera": "K1"}
        wait_until(lambda: len(_ended(service)) >= len(NAMES), "three jumps are recorded", 60, 0.1)
        assert service.call("PUT", "/api/automatic", {"on": False})[1]["automatic"]["on"] is False
        service.await_state("armed")
        before = _ended(service)
        assert [recording["session"]["athlete"] for recording in before[:3]] == NAMES
        for recording in before[:3]:
            assert recording["counts"]["pulses"] >= 1.2 * 30
            assert recording["duration_s"] < 2.6  # and not the hour for which the service runs

        wait_until(lambda: _alarms(service) == ["alarm_unrecorded_seen"], "somebody jumps unrecorded", 60, 0.1)

        service.call("PATCH", "/api/next-jumper", {"bib": "99"})
        mark = {"source": "light barrier", "time": (datetime.now(UTC) - timedelta(seconds=0.5)).isoformat()}
        first, again = service.post("/api/mark", mark), service.post("/api/mark", mark)
        assert (first["started"], again["started"]) == (True, False)
        assert _alarms(service) == [], "a recording has begun"
        assert first["recording"]["id"] == again["recording"]["id"]
        assert first["recording"]["session"]["bib"] == "99"
        wait_until(lambda: len(_ended(service)) == len(before) + 1, "the marked jump is recorded", poll_s=0.1)
        log = verify(service.data / f"{first['recording']['id']}.mcap")
        said = [event.message for event in log.events if event.name == "mark"]
        assert len(said) == 2
        assert all("by light barrier" in text for text in said)

        status, problem = service.call("POST", "/api/mark", {"time": "2026-01-01T00:00:00Z"})
        assert status == 422
        assert "give a time of the last 60 s" in problem["detail"]
        assert service.get("/api/status")["state"] == "armed"
