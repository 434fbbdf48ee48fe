"""A recorder of the service is killed while it records: the recording goes on in a second log, with its numbers."""

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from recorder.checking.verify import verify
from recorder.reading.info import info
from recorder.recovering.recover import recover
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, Serving, serving
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable
from tests.support.waiting import wait_until


def test_a_recording_goes_on_after_the_death_of_its_recorder(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback) as service:
        service.arm()
        service.call("PATCH", "/api/next-jumper", {"bib": "16"})
        recording = service.post("/api/recordings", {"bib": "17", "athlete": "Ola"})
        service.await_pulses(20)
        service.call("PATCH", f"/api/recordings/{recording['id']}", {"bib": "18"})
        _kill_recorder(service)
        status = _await_notice(service, "recording_resumed", "recording_resumed_whole")
        assert status["state"] == "recording"
        assert status["recording"]["id"] == f"{recording['id']}-part2"
        assert (status["recording"]["session"]["bib"], status["recording"]["continues"]) == ("18", recording["id"])
        service.await_pulses(status["recording"]["counts"]["pulses"] + 20)
        ended = service.post(f"/api/recordings/{recording['id']}-part2/stop")
        after = service.await_state("armed")
        assert after["notice"] == status["notice"], "it is said until the next recording"
        assert ended["continues"] == recording["id"]
        left = service.get(f"/api/recordings/{recording['id']}")
        assert (left["state"], left["session"]["bib"]) == ("unfinished", "18")
        assert (left["continued_by"], ended["continued_by"]) == (ended["id"], "")
        assert service.call("PATCH", f"/api/recordings/{left['id']}", {"gate": "9"})[1]["continued_by"] == ended["id"]
        listed = {each["id"]: each["continued_by"] for each in service.get("/api/recordings")}
        assert listed == {recording["id"]: ended["id"], ended["id"]: ""}
    first, second = (tmp_path / "data" / f"{recording['id']}{part}.mcap" for part in ("", "-part2"))
    before, account = verify(first), verify(second)
    assert not before.closed
    assert not before.ledger.missing
    assert not account.findings
    assert not account.ledger.missing
    last, times = before.ledger.last_pulse, (before.ledger.last_time, account.ledger.first_time)
    assert times[0] is not None
    assert times[1] is not None
    lost = round((times[1] - times[0]) * 30 / 1e9) - 1
    told = status["notice"]["values"]
    gaps = [pause for pause in account.ledger.pauses() if pause.between_logs]
    if lost:  # the frames that wait in the cameras' rings are not; those that the dead recorder had in hand are
        assert [(gap.after_pulse, gap.before_pulse, gap.pulses) for gap in gaps] == [(last, last + lost + 1, lost)]
        assert (told["first"], told["last"]) == (last + 1, last + lost)
        assert account.verdict == "partial"
        assert (ended["verdict"]["code"], ended["verdict"]["values"]["unrecorded"]) == ("verdict_continued", lost)
    else:
        assert (gaps, status["notice"]["code"]) == ([], "recording_resumed_whole")
    found = info(second)
    assert (found.session["continues"], found.session["continues_after"]) == (recording["id"], str(last))
    assert (found.session["bib"], found.session["athlete"]) == ("18", "Ola")
    whole = recover(second, tmp_path / "whole.mcap")
    assert whole.lossless
    assert verify(tmp_path / "whole.mcap").ledger.pauses() == account.ledger.pauses()
    what, said = "kill -9 of the recorder of the service", status["notice"]["text"].rpartition(": ")[0]
    fault_table.tell("Processes", what, lost=f"{lost}, between the two logs", said=said)


@pytest.mark.long  # what the service decides then is a row of a table in tests/service/supervision
def test_a_recorder_that_dies_again_and_again_ends_the_recording_and_the_next_one_is_whole(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback) as service:
        service.arm()
        recording = service.post("/api/recordings", {})
        for part in ("", "-part2", "-part3"):
            _await_recording(service, f"{recording['id']}{part}")
            _kill_recorder(service)
        status = _await_notice(service, "recording_ended")
        assert "3 times within 60 s" in status["notice"]["text"]
        assert not list(service.data.glob("*-part4.mcap"))
        again = service.post("/api/recordings", {"duration_s": 0.5})
        service.await_state("armed")
        assert service.get(f"/api/recordings/{again['id']}")["state"] == "finished"
    what = "kill -9 of the recorder of the service, three times within a minute"
    fault_table.tell(
        "Processes", what, lost="those from then on; the next recording is whole", said=status["notice"]["text"]
    )


def _kill_recorder(service: Serving) -> None:
    os.kill(service.pids()["recorder"], signal.SIGKILL)


def _await_recording(service: Serving, recording: str) -> None:
    """Wait until a log of the recording has pulses."""

    def goes_on() -> bool:
        status = service.get("/api/status")
        now = status["recording"]
        notice = status["notice"]
        begun = recording.endswith("Z") or (notice is not None and notice["values"].get("recording") == recording)
        return status["state"] == "recording" and now["id"] == recording and begun and now["counts"]["pulses"] > 5

    wait_until(goes_on, f"{recording} has pulses, log:\n{service.log.read_text()}", PATIENCE_S, 0.05)


def _await_notice(service: Serving, *codes: str) -> dict[str, Any]:
    """Wait until the service says something of a recording.

    Returns:
        The status.
    """

    def said() -> bool:
        notice = service.get("/api/status")["notice"]
        return notice is not None and notice["code"] in codes

    wait_until(said, f"a notice {codes}, log:\n{service.log.read_text()}", PATIENCE_S, 0.05)
    status: dict[str, Any] = service.get("/api/status")
    return status
