"""`svev record` and the service split a recording into parts: no pulse is lost, whatever the disk does meanwhile."""

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from recorder.catalogue.folder import Catalogue
from recorder.checking.verify import verify
from recorder.reading.info import info
from recorder.reading.parts import parts_of
from recorder.reading.triplets import tags
from rig.pulse import PulseNumber
from rig.settings.file import load_rig
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, serving
from tests.support.faulty_disk import Call, FaultyDisk
from tests.support.loopback import Loopback
from tests.support.stamps import hill_pulses
from tests.support.waiting import wait_until

SVEV = [sys.executable, "-m", "svev"]


def _rig(folder: Path, loopback: Loopback, recorder: str = "") -> Path:
    rig = write_rig(folder, "sim", loopback)
    rig.write_text(rig.read_text().replace("[network]", f"[recorder]\nreserve_gb = 0\n{recorder}\n[network]"))
    return rig


def _record(
    rig: Path, out: Path, seconds: float, *options: str, disk: FaultyDisk | None = None
) -> subprocess.Popen[str]:
    command = [*SVEV, "record", "--rig", str(rig), "--seconds", str(seconds), "--out", str(out), "--json", *options]
    environment = os.environ | ({} if disk is None else disk.environment)
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


def _result(process: subprocess.Popen[str]) -> dict[str, Any]:
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, err
    result: dict[str, Any] = json.loads(out)
    return result


def _check_whole(first: Path, pulses: int) -> None:
    """All parts together hold these pulses, without a gap, each from the same moment of the hill."""
    about = info(first, whole=True)
    assert (about.ledger.pulses, about.ledger.missing, about.ledger.out_of_order) == (pulses, [], [])
    assert about.ledger.pauses() == ()
    assert [tag.pulse for tag in tags(first)] == list(range(1, pulses + 1))


@pytest.mark.parametrize("limit", [("--part-s", "1.5"), ("--part-gb", "0.042")])
def test_a_recording_is_split_between_pulses(tmp_path: Path, loopback: Loopback, limit: tuple[str, str]) -> None:
    rig = _rig(tmp_path, loopback)
    result = _result(_record(rig, tmp_path / "logs", 5, *limit))
    logs = [Path(log) for log in result["logs"]]
    assert len(logs) == 4
    assert parts_of(logs[2]) == tuple(logs)
    assert (result["pulses"], result["log"]) == (150, str(logs[-1]))
    reports = [verify(log) for log in logs]
    assert not any(report.damaged or report.part_before or report.part_after for report in reports)
    assert sum(report.ledger.pulses for report in reports) == 150
    assert all(45 - 1 <= report.ledger.pulses <= 45 for report in reports[:-1])
    assert all(log.stat().st_size <= 0.042e9 for log in logs)
    assert info(logs[-1]).session["recording"] == logs[0].stem
    _check_whole(logs[0], 150)
    hill = hill_pulses(logs[0], load_rig(rig))
    begin = min(hill[PulseNumber(1)])
    assert hill == {PulseNumber(pulse): {begin + pulse - 1} for pulse in range(1, 151)}, "no frame is mixed or lost"
    (entry,) = Catalogue(tmp_path / "logs").entries()
    assert (entry.id, entry.pulses, entry.parts) == (logs[0].stem, 150, tuple(log.stem for log in logs))


def test_limits_are_changed_while_armed_and_kept_in_the_rig_file(tmp_path: Path, loopback: Loopback) -> None:
    """They hold from the next recording on, not for one that runs."""
    rig = _rig(tmp_path, loopback)
    with serving(tmp_path, rig, loopback) as service:
        service.arm()
        assert service.get("/api/parts") == {"part_s": None, "part_gb": None, "saved": True}
        running = service.post("/api/recordings", {"preroll_s": 0})["id"]
        _, now = service.call("PATCH", "/api/parts", {"part_s": 1})
        assert now == {"part_s": 1.0, "part_gb": None, "saved": False}
        service.await_pulses(45)
        service.post(f"/api/recordings/{running}/stop")
        split = service.post("/api/recordings", {"preroll_s": 0})["id"]
        service.await_pulses(45)
        service.post(f"/api/recordings/{split}/stop")
        listed = {each["id"]: len(each["parts"]) for each in service.get("/api/recordings")}
        assert listed[running] == 1
        assert listed[split] > 1
        _, now = service.call("PATCH", "/api/parts", {"part_gb": 4, "part_s": 600, "save": True})
        assert now == {"part_s": 600.0, "part_gb": 4.0, "saved": True}
        _check_whole(service.data / f"{split}.mcap", info(service.data / f"{split}.mcap", whole=True).ledger.pulses)
        attached = service.get("/api/rig")["toml"]
    kept = load_rig(rig).recorder
    assert (kept.part_s, kept.part_gb, kept.reserve_gb) == (600, 4, 0)
    assert attached == rig.read_text()


@pytest.mark.long
def test_a_disk_that_lets_no_part_be_made_costs_no_pulse(tmp_path: Path, loopback: Loopback, disk: FaultyDisk) -> None:
    recording = _record(_rig(tmp_path, loopback), tmp_path / "logs", 6, "--part-s", "1.5", disk=disk)
    wait_until(lambda: any((tmp_path / "logs").glob("*.mcap")), "it has begun", PATIENCE_S)
    disk.fail(errno.ENOSPC, Call.OPEN)
    wait_until(lambda: disk.hits > 0, "a part was refused", PATIENCE_S)
    disk.heal()
    result = _result(recording)
    logs = [Path(log) for log in result["logs"]]
    assert len(logs) == 3
    assert not any(verify(log).damaged for log in logs)
    assert 85 <= verify(logs[0]).ledger.pulses <= 90
    _check_whole(logs[0], 180)


@pytest.mark.long
def test_a_full_disk_at_a_split_ends_the_recording_with_a_whole_chain(
    tmp_path: Path, loopback: Loopback, disk: FaultyDisk
) -> None:
    recording = _record(_rig(tmp_path, loopback), tmp_path / "logs", 60, "--part-s", "1", disk=disk)
    wait_until(lambda: len([*(tmp_path / "logs").glob("*.mcap")]) > 1, "it is split", PATIENCE_S)
    disk.fail(errno.ENOSPC, Call.WRITE | Call.OPEN)
    out, _ = recording.communicate(timeout=PATIENCE_S)
    disk.heal()
    result = json.loads(out)
    assert recording.returncode == 4
    logs = [Path(log) for log in result["logs"]]
    assert {*(tmp_path / "logs").glob("*.mcap")} == {*logs}, "no empty part is left"
    _check_whole(logs[0], result["pulses"])


@pytest.mark.long
@pytest.mark.parametrize("part", [2, 3])
def test_a_recorder_that_is_killed_at_a_split_loses_nothing_that_was_on_the_disk(
    tmp_path: Path, loopback: Loopback, part: int
) -> None:
    """Killed as soon as the next part is there: the one before it may not be closed, and no pulse stands in it."""
    rig = _rig(tmp_path, loopback, "part_s = 1")
    with serving(tmp_path, rig, loopback) as service:
        service.arm()
        recording = service.post("/api/recordings", {"preroll_s": 0})["id"]
        following = service.data / f"{recording}-part{part}.mcap"
        wait_until(following.exists, "the next part is there", PATIENCE_S, 0.001)
        counted = service.get("/api/status")["recording"]["counts"]["pulses"]
        os.kill(service.pids()["recorder"], signal.SIGKILL)
        wait_until(
            lambda: service.get("/api/status")["recording"]["counts"]["pulses"] > counted + 45, "it goes on", PATIENCE_S
        )
        ended = service.post(f"/api/recordings/{recording}/stop")
        listed = {each["id"]: each for each in service.get("/api/recordings")}
    logs = sorted(service.data.glob("*.mcap"), key=lambda log: (len(log.name), log.name))
    numbers = [tag.pulse for log in logs for tag in tags(log) if parts_of(log)[0] == log]
    assert numbers == sorted(set(numbers))
    assert numbers[0] == 1
    assert len(numbers) >= counted
    assert sum(each["counts"]["pulses"] for each in listed.values()) == len(numbers)
    assert ended["id"] in listed
    assert listed[recording]["continued_by"] in listed
