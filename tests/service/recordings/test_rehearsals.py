"""Rehearsals of a real service: one at a time, out of the way of those who want to jump, remembered."""

from contextlib import closing
from pathlib import Path

import pytest

from rig.events import Event
from rig.settings.file import load_rig
from service.rehearsals import Rehearser
from svev.serving.composition import REHEARSE
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, Serving, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long


def _progress(service: Serving) -> str:
    rehearsal = service.get("/api/status")["rehearsal"]
    return "" if rehearsal is None else rehearsal["stage"]


def _rehearser(rig: Path, folder: Path, events: list[Event]) -> Rehearser:
    return Rehearser(REHEARSE, lambda: (load_rig(rig), rig.read_text()), folder, events.append, lambda: None)


def test_a_rehearsal_gives_way_to_arming_and_its_verdict_outlives_the_service(
    tmp_path: Path, loopback: Loopback
) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    with serving(tmp_path, rig, loopback) as service:
        assert service.get("/api/rehearsal") == {"running": None, "last": None}
        status, begun = service.call("POST", "/api/rehearsal", {"seconds": 60})
        assert (status, begun["running"]["stage"]) == (202, "connecting")
        wait_until(lambda: _progress(service) == "recording", "it records", PATIENCE_S, 0.05)

        # A second tap, or another phone, gets the one that runs; a jump is refused with what to do; arming ends it.
        again = service.call("POST", "/api/rehearsal", {"seconds": 0.5})[1]
        assert again["running"]["pulses"] == 60 * 30
        assert len(list(service.data.glob(".rehearsal-*"))) == 1
        assert service.get("/api/status")["statement"]["code"] == "state_rehearsing"
        refused = service.call("POST", "/api/recordings")
        assert (refused[0], refused[1]["code"]) == (409, "rehearsing")
        assert "arm the rig, which ends it" in refused[1]["detail"]
        assert {"check_rehearsing"} <= {each["code"] for each in service.get("/api/doctor")["findings"]}
        service.arm()
        assert service.get("/api/rehearsal") == {"running": None, "last": None}
        assert not list(service.data.glob(".rehearsal-*"))
        status, refused = service.call("POST", "/api/rehearsal")
        assert (status, refused["code"]) == (409, "state_forbids")
        assert "disarm" in refused["detail"]

        service.post("/api/disarm")
        service.await_state("idle")
        assert service.call("POST", "/api/rehearsal", {"seconds": 0.5})[0] == 202
        wait_until(lambda: _progress(service) == "", "a verdict", PATIENCE_S, 0.05)
        last = service.get("/api/rehearsal")["last"]
        # A crowded computer may lose frames, and its disk may be slow; then it has to say so.
        assert last["verdict"] in {"ready", "warned", "not_ready"}, last
        assert (last["pulses"], last["jumps"] > 0, last["headroom"]["disk"] > 0) == (15, True, True)
        assert {"check_read_back", "check_spread"} <= {each["code"] for each in last["findings"]}
        assert service.get("/api/recordings") == []
        service.call("POST", "/api/rehearsal", {"seconds": 60})
    assert not list(service.data.glob(".rehearsal-*"))  # the service ended it
    with closing(_rehearser(rig, service.data, [])) as another:
        assert another.view().model_dump(mode="json") == {"running": None, "last": last}


def test_what_cannot_be_rehearsed_says_why(tmp_path: Path, loopback: Loopback) -> None:
    """The cameras' back end finds nobody at their addresses."""
    text = write_rig(tmp_path, "aravis", loopback).read_text()
    simulation = text[text.index("[simulation]") : text.index("[network]")]
    rig = tmp_path / "away.toml"
    rig.write_text(text.replace(simulation, "settle_s = 1\n"))
    events: list[Event] = []
    with closing(_rehearser(rig, tmp_path, events)) as rehearser:
        rehearser.begin(0.5)
        wait_until(lambda: rehearser.progress is None, "a verdict", PATIENCE_S, 0.05)
        last = rehearser.view().last
    assert last is not None
    assert (last.verdict.value, last.statement.code, last.jumps) == ("failed", "rehearsal_failed", None)
    assert "K1" in last.statement.text
    assert [(each.code, each.level.value) for each in events] == [("event_rehearsed", "warning")]
