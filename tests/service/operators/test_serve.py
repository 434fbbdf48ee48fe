"""`svev serve` as an operator uses it: real processes, real HTTP, the simulated hill."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from recorder.catalogue.database import NAME
from recorder.checking.verify import verify
from recorder.reading.info import info
from recorder.reading.log_reader import LogReader
from rig.topics import RIG_ATTACHMENT, TAG
from tests.capture.rigs import write_rig
from tests.recorder.catalogue.bad_files import GOOD, write_bad_files
from tests.service.serving import PATIENCE_S, serving
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable
from tests.support.repeats import repeats
from tests.support.waiting import wait_until


def test_arm_record_stop_disarm(tmp_path: Path, loopback: Loopback) -> None:
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback) as service:
        assert service.state() == "idle"
        assert service.call("POST", "/api/recordings", {})[0] == 409
        service.arm()
        service.await_cameras("ready", "ready", "ready")
        recording = service.post("/api/recordings", {"athlete": "Ola", "bib": "17", "wind": "0.5 m/s"})
        assert service.state() == "recording"
        assert service.call("POST", "/api/recordings", {})[0] == 409
        assert service.call("POST", "/api/disarm")[0] == 409
        assert service.call("DELETE", f"/api/recordings/{recording['id']}")[0] == 409
        service.await_pulses(30)
        changed = service.call("PATCH", f"/api/recordings/{recording['id']}", {"bib": "18"})[1]
        assert (changed["state"], changed["session"]["bib"]) == ("recording", "18")
        ended = service.post(f"/api/recordings/{recording['id']}/stop")
        assert ended["state"] == "finished"
        assert ended["counts"]["pulses"] == ended["counts"]["complete"] >= 30
        assert ended["session"] == changed["session"]
        assert service.post(f"/api/recordings/{recording['id']}/stop") == ended, "stopping again changes nothing"
        assert service.get("/api/status")["last_recording"] == recording["id"]
        short = service.post("/api/recordings", {"duration_s": 1.0, "preroll_s": 0.0})["id"]
        service.await_state("armed")
        assert 30 <= service.get(f"/api/recordings/{short}")["counts"]["pulses"] <= 33, "it ends by itself"
        service.post("/api/disarm")
        service.await_state("idle")
        log = service.data / f"{recording['id']}.mcap"
        truth = log.with_suffix(".truth.json")
        assert len(json.loads(truth.read_text())["hill_pulse_of_recording"]) == ended["counts"]["pulses"]
    assert verify(log).verdict == "clean"
    assert info(log).session["athlete"] == "Ola"
    with LogReader(log) as reader:
        assert any(True for _ in reader.messages(TAG.name))
        assert reader.attachments[RIG_ATTACHMENT] == (tmp_path / "rig.toml").read_bytes()


@pytest.mark.parametrize("number", repeats([signal.SIGTERM, signal.SIGINT]))
def test_a_signal_while_recording_finishes_the_file(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable, number: signal.Signals
) -> None:
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback) as service:
        service.arm()
        service.post("/api/recordings", {})
        service.await_pulses(20)
        with service.watching("/api/events"), service.watching("/api/preview.mjpg"):
            service.signal(number)
            service.signal(number)
            assert service.exit_code() == 0, service.log.read_text()
    (log,) = (tmp_path / "data").glob("*.mcap")
    assert verify(log).verdict == "clean"
    fault_table.tell(
        "Processes", f"{number.name} to the service while recording", lost=0, said="the log is clean", code=0
    )


@pytest.mark.parametrize("place", ["> >(true)", "> /dev/full"])
def test_nobody_reads_the_address_of_the_panel_and_the_service_goes_on(
    tmp_path: Path, loopback: Loopback, place: str
) -> None:
    prefix = ("bash", "-c", f'exec "$@" {place}', "svev")
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback, prefix=prefix) as service:
        service.arm()
        assert service.get("/api/status")["state"] == "armed"


def test_signals_that_keep_coming_do_not_spoil_the_end(tmp_path: Path, loopback: Loopback) -> None:
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback) as service:

        def gone() -> bool:
            os.kill(service.pid, signal.SIGTERM)
            return Path(f"/proc/{service.pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"

        wait_until(gone, "the service has ended", PATIENCE_S, 0.001)
        assert service.exit_code() == 0, service.log.read_text()


def test_a_killed_grabber_comes_back(tmp_path: Path, loopback: Loopback, fault_table: FaultTable) -> None:
    with serving(tmp_path, write_rig(tmp_path, "sim", loopback), loopback) as service:
        service.arm()
        recording = service.post("/api/recordings", {})
        service.await_pulses(10)
        pid = service.pids()["K2"]
        os.kill(pid, signal.SIGKILL)
        wait_until(lambda: service.pids()["K2"] != pid, "a new grabber", PATIENCE_S)
        assert service.await_cameras("ready", "ready", "ready")["state"] == "recording"
        rows = {process["name"]: process for process in service.get("/api/status")["processes"]}
        assert rows["K2"]["restarts"] == 1
        assert rows["K2"]["statement"]["code"] == "process_restarted"
        ended = service.post(f"/api/recordings/{recording['id']}/stop")
        assert ended["counts"]["causes"]["absent"] > 0
        assert "K2: grabber process ended (killed by SIGKILL)" in service.log.read_text()
    lost = f"none: {ended['counts']['causes']['absent']} frames of K2, absent"
    said = rows["K2"]["statement"]["text"]
    fault_table.tell("Processes", "kill -9 of a grabber of the service", lost=lost, said=said)


def test_a_killed_service_leaves_a_whole_log_and_no_process(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    with serving(tmp_path, rig, loopback, ends_with=-signal.SIGKILL) as service:
        service.arm()
        recording = service.post("/api/recordings", {})
        service.await_pulses(20)
        pids = service.pids()
        service.signal(signal.SIGKILL)
        assert service.exit_code() == -signal.SIGKILL
        wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in pids.values()), "all gone", PATIENCE_S)
    report = verify(service.data / f"{recording['id']}.mcap")
    assert report.closed
    said = next(event.message for event in report.events if "service process is gone" in event.message)
    what = f"{said} (event in the log); the log is closed"
    fault_table.tell(
        "Processes", "kill -9 of the service while recording", lost="those from then on", said=what, code=-9
    )
    with serving(tmp_path, rig, loopback) as again:
        (found,) = again.get("/api/recordings")
        assert (found["id"], found["state"]) == (recording["id"], "finished")


def test_a_second_service_is_refused(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    with serving(tmp_path, rig, loopback) as service:
        port = service.url.rsplit(":", 1)[1]
        for arguments, words in (
            (["--data", str(tmp_path / "data"), "--port", "0"], f"another svev serve (process {service.pid}) uses it"),
            (["--data", str(tmp_path / "other"), "--port", port], f"svev serve (process {service.pid}) runs there"),
        ):
            done = subprocess.run(
                [sys.executable, "-m", "svev", "serve", "--rig", str(rig), "--host", loopback.host, *arguments],
                capture_output=True,
                text=True,
                timeout=PATIENCE_S,
                check=False,
            )
            assert done.returncode == 2
            assert words in done.stderr
            assert len(done.stderr.strip().splitlines()) == 1


def test_without_cameras_the_api_works_and_says_what_to_do(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "aravis", loopback)
    rig.write_text(rig.read_text().replace('[simulation]\nscenario = "scenario.toml"\n', ""))
    with serving(tmp_path, rig, loopback) as service:
        service.post("/api/arm")
        status = service.await_state("fault")
        assert status["statement"]["code"] == "fault_no_camera"
        assert [camera["state"] for camera in status["cameras"]] == ["absent"] * 3
        assert all(loopback.block in camera["statement"]["text"] for camera in status["cameras"])
        assert service.call("POST", "/api/recordings", {})[0] == 409
        began = time.monotonic()
        service.post("/api/disarm")
        service.await_state("idle")
        assert time.monotonic() - began < PATIENCE_S


def test_bad_files_among_the_recordings_are_bad_rows_also_after_a_restart(tmp_path: Path, loopback: Loopback) -> None:
    rig, data = write_rig(tmp_path, "sim", loopback), tmp_path / "data"
    data.mkdir()
    bad = write_bad_files(data)
    lists = []
    for _ in range(2):
        with serving(tmp_path, rig, loopback) as service:
            lists.append(service.get("/api/recordings"))
    assert lists[0] == lists[1]
    rows = {each["id"]: each for each in lists[0]}
    assert set(rows) == bad | {GOOD}
    assert rows[GOOD]["verdict"]["code"] == "verdict_complete"
    assert {row["verdict"]["level"] for name, row in rows.items() if name != GOOD} <= {"warning", "error"}
    assert (data / NAME).stat().st_uid == os.geteuid()
