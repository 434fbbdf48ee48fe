"""Second taps, forgotten recordings and mishaps, against a real service: nothing that an operator does costs a jump."""

import json
from pathlib import Path
from typing import Any

import pytest

from recorder.reading.info import info
from recorder.reading.triplets import tags
from tests.capture.rigs import write_rig
from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long


def _seen(service: Serving, name: str) -> tuple[int, float]:
    """Number of the present state, and a figure of its guard, s."""
    guard = service.get("/api/status")["guard"]
    return guard["number"], guard[name]


def _settled(service: Serving, name: str = "hold_s") -> int:
    """Wait until the state is not new any more; returns its number."""
    wait_until(lambda: _seen(service, name)[1] == 0, "the state is not new any more")
    return _seen(service, name)[0]


def _refused(answer: tuple[int, Any], code: str) -> str:
    status, problem = answer
    assert (status, problem["code"]) == (409, code), problem
    assert "\n" not in problem["detail"]
    detail: str = problem["detail"]
    return detail


def test_taps_and_next_jumpers_over_a_restart(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    with serving(tmp_path, rig, loopback, "--preroll", "20") as service:
        service.call_table("bib;athlete;class\n17;Anna;J18\n18;Berit;\n19;Åse;\n".encode("latin-1"))
        service.arm()
        number, _ = _seen(service, "hold_s")
        said = _refused(service.call("POST", "/api/recordings", {"seen": number}), "too_soon")
        assert "second tap" in said
        number = _settled(service)
        first = service.post("/api/recordings", {"seen": number})
        assert first["session"]["athlete"] == "Anna"
        _refused(service.call("POST", "/api/recordings", {"seen": number}), "changed_meanwhile")
        service.await_pulses(10)

        # A second tap on Record means "Stop" by now; so does one of another phone, which still shows "Record".
        stop = f"/api/recordings/{first['id']}/stop"
        present, _ = _seen(service, "hold_s")
        said = _refused(service.call("POST", stop, {"seen": present}), "confirm_first")
        assert "hold the button" in said
        _refused(service.call("POST", stop, {"seen": number, "confirm": True}), "changed_meanwhile")
        assert service.state() == "recording"

        # A mishap, confirmed: the jumper is next again, and the next recording reaches back over the first one.
        ended = service.post(stop, {"seen": present, "confirm": True})
        assert ended["session"]["bib"] == "17"
        assert service.get("/api/next-jumper")["session"]["bib"] == "17"
        again = service.post("/api/recordings", {"seen": _settled(service)})
        assert again["session"]["bib"] == "17"
        service.call("PATCH", "/api/next-jumper", {"athlete": "Berit B", "wind": "calm"})
        service.await_pulses(20)
        assert service.post(f"/api/recordings/{again['id']}/stop", {"seen": _settled(service, "confirm_s")})

        # A program that sends no `seen` is obeyed at once, and needs no confirmation.
        for _ in range(2):
            made = service.post("/api/recordings", {"preroll_s": 0})
            service.post(f"/api/recordings/{made['id']}/stop")
        assert service.get("/api/next-jumper")["session"]["bib"] == "17", "the list went round"
    logs = {each: info(service.data / f"{each}.mcap") for each in (first["id"], again["id"])}
    assert logs[first["id"]].session["class"] == "J18"
    assert logs[again["id"]].session["athlete"] == "Anna", "an edit of the next jumper changes no recording"
    mishap, whole = (
        [int(tag.cameras[0].device_time or 0) for tag in tags(service.data / f"{each}.mcap")]
        for each in (first["id"], again["id"])
    )
    # Both begin when the rig was armed, as far as the service knows it: messages take their time.
    shared = [time for time in mishap if time >= whole[0]]
    assert whole[: len(shared)] == shared, "what the mishap had recorded is in the next recording too"
    assert len(shared) > len(mishap) // 2
    assert len(set(whole)) == len(whole)
    with serving(tmp_path, rig, loopback) as service:
        found = service.get("/api/start-list")
        assert (found["round"], found["next"]["session"]["bib"], found["next"]["session"]["wind"]) == (2, "17", "calm")
        assert [len(line["jumps"]) for line in found["lines"]] == [1, 1, 1]


def test_a_forgotten_recording_ends_and_says_so(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    rig.write_text(rig.read_text() + "[recorder]\nlongest_s = 1.5\n")
    with serving(tmp_path, rig, loopback) as service:
        service.arm()
        made = service.post("/api/recordings", {"bib": "5"})
        status = service.await_state("armed")
        assert status["notice"]["code"] == "recording_forgotten"
        # A camera that fails meanwhile, as on a busy computer, is told first.
        assert status["statement"]["code"] in ("recording_forgotten", "state_armed_partly")
        assert "1.5 s" in status["notice"]["text"]
        verdict = service.get(f"/api/recordings/{made['id']}")["verdict"]
        assert (verdict["code"], verdict["level"]) == ("verdict_forgotten", "warning")
        assert "after 1.5 s, because nobody had stopped it" in verdict["text"]
        longer = service.post("/api/recordings", {"duration_s": 2.0, "preroll_s": 0})
        assert service.get("/api/status")["notice"] is None
        service.await_state("armed")
        told = service.get(f"/api/recordings/{longer['id']}")["verdict"]
        assert told["code"] != "verdict_forgotten", "somebody said how long it was to be"
    assert json.loads((service.data / ".svev-start-list.json").read_text())["version"] >= 1
