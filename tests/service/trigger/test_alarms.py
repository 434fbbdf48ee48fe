"""A real service with simulated cameras says what goes wrong between jumps, and that it is over."""

from pathlib import Path

import pytest

from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long

#: Every 12 s the pulses stop for 5 s; before that K2 misses every second pulse for two seconds.
EVERY, PAUSE, MISSED = 360, (210, 360), range(100, 160, 2)
TIMES = 10


def test_stopped_pulses_and_a_camera_that_misses_some_are_alarms_with_an_end(
    tmp_path: Path, loopback: Loopback
) -> None:
    pauses = [[PAUSE[0] + EVERY * time, PAUSE[1] + EVERY * time] for time in range(TIMES)]
    faults = [
        {"kind": "missed_pulse", "camera": "K2", "at_pulse": pulse + EVERY * time}
        for time in range(TIMES)
        for pulse in MISSED
    ]
    rig = write_rig(tmp_path, "sim", loopback, faults=faults, scenario=f"pauses = {pauses}", names=("K1", "K2"))
    with serving(tmp_path, rig, loopback) as service:
        service.arm()

        def alarmed() -> set[str]:
            return {alarm["statement"]["code"] for alarm in service.get("/api/status")["alarms"]}

        wait_until(lambda: alarmed() >= {"alarm_missed", "alarm_stopped"}, "both alarms", PATIENCE_S, 0.1)
        status = service.get("/api/status")
        assert status["state"] == "armed", "an alarm is no fault"
        assert status["statement"]["level"] == "error"
        topics = {alarm["topic"]: alarm["statement"]["text"] for alarm in status["alarms"]}
        assert topics["camera K2"].startswith("K2 misses pulses, ")
        wait_until(lambda: "alarm_stopped" not in alarmed(), "the pulses are back", PATIENCE_S, 0.1)
        said = [line.partition(" ")[2] for line in service.log.read_text().splitlines()]
        begun = [line for line in said if line.startswith("error   trigger: the pulses have stopped")]
        over = [line for line in said if line.startswith("info    trigger: over: the pulses have stopped")]
        assert 1 <= len(over) <= len(begun) <= TIMES, said
        service.post("/api/disarm")
        assert service.await_state("idle")["alarms"] == []
