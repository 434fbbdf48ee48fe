"""Disks that fail, hang, are slow, and logs that vanish, under a real `svev record` and `svev serve`.

Whatever the disk does: what is said agrees with what is in the logs, and the end comes.
"""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from recorder.checking.verify import VerifyReport, verify
from recorder.reading.info import info
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, Serving, serving
from tests.support.faulty_disk import SMALL, Call, FaultyDisk
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable
from tests.support.waiting import let_pass, wait_until

pytestmark = pytest.mark.long

DISK = "The disk"
AFTER = "those from then on"
SVEV = [sys.executable, "-m", "svev"]


class Record:
    """A running `svev record` on a disk with faults."""

    def __init__(self, rig: Path, out: Path, seconds: float, disk: FaultyDisk) -> None:
        self.out, self._said = out, rig.with_suffix(".err")
        command = [*SVEV, "record", "--rig", str(rig), "--seconds", str(seconds), "--out", str(out), "--json"]
        with self._said.open("w") as said:
            self.process = subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=said, text=True, env=os.environ | disk.environment
            )

    def said(self) -> str:
        """What it has said to standard error."""
        return self._said.read_text()

    def await_words(self, words: str) -> None:
        """Wait until it has said something."""
        wait_until(lambda: words in self.said(), words, PATIENCE_S)

    def await_bytes(self, count: int) -> Path:
        """Wait until the log has so many bytes."""
        wait_until(lambda: any(log.stat().st_size > count for log in self.out.glob("*.mcap")), "recording", PATIENCE_S)
        (log,) = self.out.glob("*.mcap")
        return log

    def result(self, timeout_s: float = 120) -> tuple[int, dict[str, Any], str]:
        """Exit code, the JSON object, and what was said to standard error."""
        out, _ = self.process.communicate(timeout=timeout_s)
        return self.process.returncode, json.loads(out) if out else {}, self.said()


def _rig(folder: Path, loopback: Loopback, recorder: str = "") -> Path:
    rig = write_rig(folder, "sim", loopback)
    rig.write_text(rig.read_text().replace("[network]", f"[recorder]\nreserve_gb = 0\n{recorder}\n[network]"))
    return rig


def _agree(result: dict[str, Any], *reports: VerifyReport) -> None:
    """The figures that were said are those of the logs."""
    for figure in ("pulses", "complete"):
        assert result[figure] == sum(getattr(report.ledger, figure) for report in reports), figure
    assert [result["logs"][-1]] == [result["log"]]


@pytest.mark.parametrize(
    ("error", "words"), [(errno.ENOSPC, "the disk is full: make room"), (errno.EIO, "the disk fails: look at `dmesg`")]
)
@pytest.mark.parametrize("size", ["small", "large"])
def test_a_failed_write_of_any_size_ends_the_recording_and_is_said(
    tmp_path: Path, loopback: Loopback, disk: FaultyDisk, fault_table: FaultTable, error: int, words: str, size: str
) -> None:
    recording = Record(_rig(tmp_path, loopback), tmp_path / "logs", 60, disk)
    recording.await_bytes(20_000_000)
    if size == "small":
        disk.fail(error, most=SMALL)
    else:
        disk.fail(error, least=SMALL)
    code, result, err = recording.result()
    assert code == 4, err
    assert words in err
    assert disk.hits > 0
    report = verify(Path(result["log"]))
    _agree(result, report)
    assert not report.ledger.missing
    what = "an event or health record" if size == "small" else "a triplet"
    fault_table.tell(DISK, f"{errno.errorcode[error]} on a write of {what}", lost=AFTER, said=_last(err), code=code)


def test_after_a_failed_write_the_service_says_so_and_the_next_recording_is_whole(
    tmp_path: Path, loopback: Loopback, disk: FaultyDisk, fault_table: FaultTable
) -> None:
    with serving(tmp_path, _rig(tmp_path, loopback), loopback, environment=disk.environment) as service:
        service.arm()
        first = service.post("/api/recordings", {"preroll_s": 0})
        service.await_pulses(20)
        disk.fail(errno.ENOSPC, most=SMALL)
        service.await_state("armed")
        statement = service.await_statement("recording_ended")
        assert "the disk is full" in statement["text"]
        disk.heal()
        second = service.post("/api/recordings", {"preroll_s": 0})
        service.await_pulses(60)
        service.post(f"/api/recordings/{second['id']}/stop")
        told = {each["id"]: each["counts"] for each in service.get("/api/recordings")}
        _tells_the_truth(service, first["id"], told)
        _tells_the_truth(service, second["id"], told)
        assert told[second["id"]]["pulses"] >= 60
    assert verify(service.data / f"{second['id']}.mcap").verdict == "clean"
    lost = f"{AFTER}; the next recording is whole"
    fault_table.tell(DISK, "ENOSPC on a write of an event, under the service", lost=lost, said=statement["text"])


def test_a_failure_that_passes_is_known_after_a_restart(tmp_path: Path, loopback: Loopback, disk: FaultyDisk) -> None:
    """The log is closed and sound; that the recording was to go on stands in the log itself."""
    recording = Record(_rig(tmp_path, loopback), tmp_path / "logs", 60, disk)
    recording.await_bytes(20_000_000)
    disk.fail(errno.EIO, least=SMALL)
    code, result, err = recording.result()
    assert code == 4, err
    log = Path(result["log"])
    report = verify(log)
    assert (report.closed, report.verdict) == (True, "partial")
    assert "the disk fails: look at `dmesg`" in report.ended_early == info(log).ended_early
    with serving(tmp_path, _rig(tmp_path, loopback), loopback, data=log.parent) as service:
        (listed,) = service.get("/api/recordings")
        assert listed["verdict"]["code"] == "verdict_ended_early"
        assert listed["verdict"]["text"].startswith("Ended early: the disk fails")
        assert listed["verdict"]["values"]["why"]["code"] == "disk_fails"


def _tells_the_truth(service: Serving, recording: str, told: dict[str, Any]) -> None:
    ledger = verify(service.data / f"{recording}.mcap").ledger
    assert (told[recording]["pulses"], told[recording]["complete"]) == (ledger.pulses, ledger.complete)


@pytest.mark.parametrize("calls", [Call.WRITE, Call.SYNC])
def test_a_disk_that_hangs_across_the_end_costs_no_tag(
    tmp_path: Path, loopback: Loopback, disk: FaultyDisk, fault_table: FaultTable, calls: Call
) -> None:
    rig = _rig(tmp_path, loopback, "ring_s = 0.5\ntriplets_s = 0.5")
    recording = Record(rig, tmp_path / "logs", 5, disk)
    recording.await_bytes(60_000_000)
    disk.hang(calls)
    recording.await_words("the disk hangs")
    # The cameras' rings overflow, and the recording's last pulse passes.
    let_pass(4.0)
    disk.heal()
    code, result, err = recording.result()
    report = verify(Path(result["log"]))
    _agree(result, report)
    assert result["pulses"] == 150, err
    assert report.verdict != "damaged", report.findings
    assert result["partial"] > 0
    assert code == 4, err
    assert "the disk hung for" in err
    assert "the disk hung for" in info(Path(result["log"])).trouble
    what = "write" if calls is Call.WRITE else "sync"
    lost = f"{result['partial']} of {result['pulses']}, with tags"
    said = f"the disk hangs: it has taken nothing for 2 s; then: {_last(err)}"
    fault_table.tell(DISK, f"{what} hangs for 6 s across the end of the recording", lost=lost, said=said, code=code)


def _last(err: str) -> str:
    """The last line that was said."""
    return err.strip().splitlines()[-1]


def test_the_page_says_that_the_disk_was_too_slow(tmp_path: Path, loopback: Loopback, disk: FaultyDisk) -> None:
    rig = _rig(tmp_path, loopback, "ring_s = 0.5\ntriplets_s = 0.5\npreroll_s = 0")
    with serving(tmp_path, rig, loopback, environment=disk.environment) as service:
        service.arm()
        disk.slow(8_000_000)
        recording = service.post("/api/recordings", {"duration_s": 4})
        service.await_state("armed")
        found = service.get(f"/api/recordings/{recording['id']}")
        live = service.log.read_text()
    assert found["verdict"]["code"] == "verdict_partial_disk"
    assert "disk too slow: it took" in found["verdict"]["advice"]
    assert "the disk falls behind" in live


@pytest.mark.parametrize("megabytes_per_s", [10, 20])
def test_a_slow_disk_is_called_slow_and_every_pulse_has_its_tag(
    tmp_path: Path, loopback: Loopback, disk: FaultyDisk, fault_table: FaultTable, megabytes_per_s: int
) -> None:
    disk.slow(megabytes_per_s * 1_000_000)
    recording = Record(_rig(tmp_path, loopback, "ring_s = 0.5\ntriplets_s = 0.5"), tmp_path / "logs", 6, disk)
    code, result, err = recording.result()
    report = verify(Path(result["log"]))
    _agree(result, report)
    assert result["pulses"] == 180, err
    assert not report.damaged, report.findings
    assert result["partial"] > 0
    assert code == 4
    assert "disk too slow: it took" in err
    assert "disk too slow: it took" in info(Path(result["log"])).trouble
    lost = f"{result['partial']} of {result['pulses']}, with tags"
    fault_table.tell(DISK, f"the disk takes {megabytes_per_s} MB/s of 27.6", lost=lost, said=_last(err), code=code)


def test_a_disk_that_hangs_for_ever_ends_at_the_second_ctrl_c(
    tmp_path: Path, loopback: Loopback, disk: FaultyDisk, fault_table: FaultTable
) -> None:
    recording = Record(_rig(tmp_path, loopback), tmp_path / "logs", 60, disk)
    log = recording.await_bytes(20_000_000)
    disk.hang(Call.ALL)
    recording.await_words("the disk hangs")
    recording.process.send_signal(signal.SIGINT)
    let_pass(1.0)
    assert recording.process.poll() is None, "it waits for the disk"
    recording.process.send_signal(signal.SIGINT)
    code, result, err = recording.result(30)
    disk.heal()
    assert code == 4
    assert "stopped without waiting for the disk" in err
    _agree(result, verify(log))
    fault_table.tell(DISK, "the disk hangs for ever; two Ctrl-C", lost=AFTER, said=_last(err), code=code)
    assert verify(log).ledger.pulses > 10


def test_a_disk_that_lets_no_file_be_made_is_named(
    tmp_path: Path, loopback: Loopback, disk: FaultyDisk, fault_table: FaultTable
) -> None:
    disk.hang(Call.OPEN)
    code, result, err = Record(_rig(tmp_path, loopback), tmp_path / "logs", 4, disk).result()
    disk.heal()
    assert (code, result) == (4, {})
    assert "the disk does not let a file be made within 10 s" in err
    fault_table.tell(DISK, "the disk hangs when the log is made", lost="all", said=_last(err), code=code)


@pytest.mark.parametrize("what", ["file", "folder", "moved"])
def test_a_log_that_vanishes_is_noticed_and_the_recording_goes_on(
    tmp_path: Path, loopback: Loopback, disk: FaultyDisk, fault_table: FaultTable, what: str
) -> None:
    recording = Record(_rig(tmp_path, loopback), tmp_path / "logs", 5, disk)
    log = recording.await_bytes(20_000_000)
    if what == "file":
        log.unlink()
    elif what == "folder":
        shutil.rmtree(log.parent)
    else:
        (tmp_path / "elsewhere").mkdir()
        log.rename(tmp_path / "elsewhere" / log.name)
    code, result, err = recording.result()
    assert code == 4, err
    assert ("was moved away" if what == "moved" else "was deleted") in err
    assert result["logs"] == [str(log), str(log.with_name(f"{log.stem}-part2.mcap"))]
    report = verify(Path(result["log"]))
    # A busy machine may lose frames, and their tags say so; the fault cost nothing but what went with the first file.
    assert not report.damaged, report.findings
    assert not report.ledger.missing
    assert not report.ledger.pauses()
    assert result["pulses"] == report.ledger.pulses > 30
    assert info(Path(result["log"])).session["continues"] == log.stem
    faults = {"file": "the log is deleted", "folder": "its folder is deleted", "moved": "the log is moved away"}
    lost = "none: they went with the file" if what == "moved" else "those that were in it"
    fault_table.tell(DISK, f"{faults[what]} while it is recorded", lost=lost, said=_last(err), code=code)


def test_a_second_disk_that_fails_too_is_said(
    tmp_path: Path, loopback: Loopback, disk: FaultyDisk, fault_table: FaultTable
) -> None:
    rig = _rig(tmp_path, loopback, f'fallback_directory = "{tmp_path / "second"}"')
    recording = Record(rig, tmp_path / "logs", 60, disk)
    recording.await_bytes(20_000_000)
    disk.fail(errno.EIO, Call.WRITE | Call.OPEN)
    code, result, err = recording.result()
    assert code == 4
    assert "there neither: " in err
    _agree(result, verify(Path(result["log"])))
    fault_table.tell(DISK, "both disks fail", lost=AFTER, said=_last(err), code=code)


@pytest.mark.parametrize("fault", ["fails", "hangs"])
def test_on_a_second_disk_the_recording_goes_on_without_a_gap(
    tmp_path: Path, loopback: Loopback, disk: FaultyDisk, fault_table: FaultTable, fault: str
) -> None:
    fallback = tmp_path / "second"
    rig = _rig(tmp_path, loopback, f'fallback_directory = "{fallback}"\ntriplets_s = 6')
    recording = Record(rig, tmp_path / "logs", 7, disk)
    first = recording.await_bytes(20_000_000)
    if fault == "fails":
        disk.fail(errno.EIO, Call.WRITE, only=tmp_path / "logs")
    else:
        disk.hang(Call.WRITE | Call.SYNC, only=tmp_path / "logs")
    code, result, err = recording.result()
    disk.heal()
    second = fallback / f"{first.stem}-part2.mcap"
    assert result["logs"] == [str(first), str(second)]
    reports = verify(first), verify(second)
    assert result["pulses"] == result["complete"] == 210, err
    assert sum(report.ledger.pulses for report in reports) >= 210
    assert (reports[1].verdict, reports[1].part_before) == ("partial", first.stem)
    assert list(reports[1].parts_in_words()) == [
        f"goes on from {first.stem}, which does not lie beside it: its pulses are not in this log"
    ]
    assert code == 0, err
    assert f"the recording goes on in {second}" in err
    assert len(json.loads(second.with_suffix(".truth.json").read_text())["hill_pulse_of_recording"]) > 100
    assert f"not written beside {first.name}" in err
    (said,) = (line for line in err.splitlines() if "goes on in" in line)
    name = "fails (EIO)" if fault == "fails" else "hangs for ever"
    fault_table.tell(DISK, f"the disk {name}; there is a second one", lost=0, said=said, code=code)
