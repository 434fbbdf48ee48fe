"""The analysis as a process of `svev serve`: it measures the jumps of a recording, and never harms it."""

import json
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.result import file as result_file
from recorder.checking.verify import verify
from recorder.log.beside import jumper_path
from recorder.reading.log_reader import LogReader
from rig.jumper import JumperState
from rig.topics import JUMPER, JUMPER_CAMERAS, JUMPER_SCENE
from service.recordings import live_results
from simrig.world.survey import survey
from tests.analysis.scene.hill import balls_in, training
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, Serving, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

#: A jump needs 9 s: 4 s for the static images, 4 s until it comes, 1 s to be over. The analysis is nice to all others.
_MEASURED_S = 3 * PATIENCE_S
pytestmark = [pytest.mark.long, pytest.mark.alone, pytest.mark.timeout(3 * _MEASURED_S)]
FIGURES = ("takeoff_speed", "perpendicular", "speed_20_m", "angle_of_attack", "ski_to_body")


def test_a_jump_is_measured_while_it_is_recorded(tmp_path: Path, loopback: Loopback) -> None:
    rig, surveyed = write_rig(tmp_path, "sim", loopback), tmp_path / "survey.json"
    rig.write_text(rig.read_text() + '[analysis]\nsurvey = "survey.json"\n')
    surveyed.write_text("{}")
    with serving(tmp_path, rig, loopback) as service:
        assert service.arm()["last_jump"] is None, "a wrong survey does not prevent recordings"
        _await_said(service, "no jump is measured before this is put right")
        wait_until(
            lambda: _alarm(service).startswith("jumps are recorded, but not measured: "), "alarm", PATIENCE_S, 0.1
        )
        surveyed.write_text(json.dumps(survey(training())))
        order = {"preroll_s": 0.0, "duration_s": 2 * _MEASURED_S}  # else it ends by itself where nobody stops it
        recording = service.post("/api/recordings", order)["id"]
        jump, pid = _await_jump(service), service.pids()["analysis"]
        assert not _alarm(service)
        _balls_are_where_they_should_be(service, recording)
        os.kill(pid, signal.SIGKILL)
        wait_until(lambda: service.pids()["analysis"] != pid, "a new process", PATIENCE_S, 0.1)
        assert service.state() == "recording"
        ended = service.post(f"/api/recordings/{recording}/stop")
        rows = {row["name"]: row for row in service.get("/api/status")["processes"]}
        said = service.log.read_text()
    assert said.count("no jump is measured before this is put right") == 1
    assert f"jump {jump['jump']} of {recording}: {jump['verdict']}" in said
    assert rows["analysis"]["restarts"] == 1
    assert ended["state"] == "finished"
    _figures_are_true(jump, recording)
    _result_is_beside_the_log(service.data / f"{recording}.mcap", jump)
    _results_are_in_the_log(service.data / f"{recording}.mcap", jump)


def _balls_are_where_they_should_be(service: Serving, recording: str) -> None:
    """By the orientation from the first four seconds, within 2 px and within what the sigmas say."""
    for name in ("K1", "K2", "K3"):
        found = service.get(f"/api/cameras/{name}/balls")
        assert (found["source"], found["recording"]) == ("orientation", recording)
        true, told = balls_in(training(), name), {ball["name"]: ball for ball in found["balls"] if ball["inside"]}
        assert {ball for ball in true if ball.startswith("B")} <= told.keys()
        for ball in (ball for ball in told if ball.startswith("B")):
            error = np.subtract((told[ball]["x"], told[ball]["y"]), true[ball])
            assert np.abs(error).max() < 2.0, (name, ball)
            assert (np.abs(error) < 5 * np.array(told[ball]["sigma"])).all(), (name, ball)


def _await_jump(service: Serving) -> dict[str, Any]:
    """The first whole jump: the recording may begin in the middle of one, and a busy machine may lose frames of one."""

    def measured() -> bool:
        jump = service.get("/api/status")["last_jump"]
        return jump is not None and None not in [jump[name] for name in FIGURES]

    wait_until(measured, "a measured jump", _MEASURED_S, 0.1)
    found: dict[str, Any] = service.get("/api/status")["last_jump"]
    return found


def _figures_are_true(jump: dict[str, Any], recording: str) -> None:
    """The simulated jumpers leave the table at about 26 m/s, each at a speed of his own."""
    assert jump["recording"] == recording
    assert abs(jump["takeoff_speed"]["value"] - 26.1) < 1.0
    for name in FIGURES:
        assert 0 < jump[name]["sigma"] < 1.0, name


def _result_is_beside_the_log(log: Path, jump: dict[str, Any]) -> None:
    measured = result_file.read(jumper_path(log))
    assert measured.recording == jump["recording"]
    assert jump in [known.model_dump(mode="json") for known in live_results.summaries(log)]
    assert len(measured.jumps) == len(live_results.summaries(log))


def _results_are_in_the_log(log: Path, jump: dict[str, Any]) -> None:
    assert verify(log).verdict != "damaged"  # a busy machine may lose frames; that is not what is tested here
    with LogReader(log) as reader:
        states = [(m.sequence, JumperState.decode(bytes(m.data or b""))) for m in reader.messages(JUMPER.name)]
        scenes = [(m.sequence, bytes(m.data or b"")) for m in reader.messages(JUMPER_SCENE.name)]
        places = [m.sequence for m in reader.messages(JUMPER_CAMERAS.name)]
    assert len(states) > 20
    assert set(places) < {pulse for pulse, _ in states}
    assert len(places) == len({state.jump for _, state in states})
    assert [pulse for pulse, _ in scenes] == [pulse for pulse, _ in states] == [state.pulse for _, state in states]
    assert {state.recording for _, state in states} == {jump["recording"]}
    assert sum(point is not None for _, state in states for point in state.points.values()) > 2 * len(states)
    assert min(len(scene) for _, scene in scenes) > 0


def _alarm(service: Serving) -> str:
    """What the alarm says that nothing is measured; "": there is none."""
    said: dict[str, str] = {
        alarm["topic"]: alarm["statement"]["text"] for alarm in service.get("/api/status")["alarms"]
    }
    return said.get("measuring", "")


def _await_said(service: Serving, words: str) -> None:
    wait_until(lambda: words in service.log.read_text(), f"an event that says: {words}", PATIENCE_S, 0.1)
