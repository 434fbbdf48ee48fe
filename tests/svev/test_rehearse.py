"""`svev rehearse`: real processes record to the real disk; what is wrong fails it, and nothing is left behind."""

import json
import signal
import subprocess
import sys
from ipaddress import IPv4Address, IPv4Network
from pathlib import Path
from typing import Any

import pytest

from recorder.checking.verify import verify
from rig.frame import FrameStatus
from rig.host.interfaces import Interface
from rig.settings.file import CONFIG, load_rig
from rig.settings.model import RigSettings
from svev.cli import main
from svev.doctor.finding import Level
from svev.rehearsal import Rehearsed, headroom_of, judge_pulses, judge_source
from tests.capture.rigs import write_rig
from tests.recorder.logs import ALL_OK, OK, write_log
from tests.support.commands import start_svev
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

ABSENT, LOST = FrameStatus.ABSENT, FrameStatus.LOST


def rehearse(rig: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, Any]]:
    arguments = ["rehearse", "--rig", str(rig), "--seconds", "1", "--out", str(folder), "--json"]
    code = main(arguments)
    return code, json.loads(capsys.readouterr().out)


def test_a_rig_that_works_is_ready_and_the_disk_is_as_before(
    tmp_path: Path, loopback: Loopback, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "recordings"
    killed = subprocess.Popen([sys.executable, "-c", ""])
    killed.wait(10)
    (out / f".rehearsal-{killed.pid}-x").mkdir(parents=True)
    (out / f".rehearsal-{killed.pid}-x" / "log.mcap").touch()
    code, found = rehearse(write_rig(tmp_path, "sim", loopback), out, capsys)
    assert found["pulses"] == 30
    failed = [finding for finding in found["findings"] if finding["level"] == "FAIL"]
    # A crowded computer may lose frames, and its disk may be slow; then it has to say so.
    assert (code, found["ready"]) == ((3, False) if failed else (0, True)), found
    if not failed:
        assert found["verdict"].startswith(f"headroom {found['headroom']['disk']:.1f}x (disk), room for ")
    assert set(found["latency_ms"]) == {"K1", "K2", "K3"}
    codes = {finding["code"] for finding in found["findings"]}
    assert {"check_disk_speed", "check_room", "check_read_back", "check_dead_time", "check_spread"} <= codes
    assert list(out.iterdir()) == []


def _end_when_there_is(pattern: str, rig: Path, out: Path, *more: str) -> None:
    """Rehearse, end it by SIGTERM when there is such a file in `out`: it says no verdict, and leaves nothing."""
    with start_svev("rehearse", "--rig", str(rig), "--out", str(out), "--json", *more) as rehearsing:
        wait_until(lambda: any(out.glob(pattern)), pattern, timeout_s=60)
        rehearsing.send_signal(signal.SIGTERM)
        code = rehearsing.wait(30)
        said, complaint = rehearsing.written()
    assert (code, said) == (130, ""), complaint
    assert list(out.iterdir()) == []


def test_one_that_is_interrupted_gives_no_verdict(tmp_path: Path, loopback: Loopback) -> None:
    out = tmp_path / "recordings"
    rig = write_rig(tmp_path, "sim", loopback)
    _end_when_there_is(".rehearsal-*/*.mcap", rig, out, "--seconds", "60")


def test_one_that_is_ended_before_its_recording_begins_leaves_nothing_behind(
    tmp_path: Path, loopback: Loopback
) -> None:
    out = tmp_path / "recordings"
    rig = write_rig(tmp_path, "sim", loopback, scenario="pauses = [[0, 100000]]")
    rig.write_text(rig.read_text().replace("rate_hz = 30.0", "rate_hz = 30.0\nsettle_s = 60.0"))
    _end_when_there_is(".rehearsal-*", rig, out)


def test_what_is_wrong_is_named_with_what_to_do(
    tmp_path: Path, loopback: Loopback, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each fifth frame of K2 is lost, and K3 exposes for longer than a period."""
    faults = [{"kind": "lost_frame", "camera": "K2", "at_pulse": pulse} for pulse in range(5, 3000, 5)]
    rig = write_rig(tmp_path, "sim", loopback, faults=faults)
    rig.write_text(rig.read_text() + "exposure_us = 40000\n")
    code, found = rehearse(rig, tmp_path / "recordings", capsys)
    assert (code, found["ready"]) == (3, False)
    assert found["causes"]["lost"] >= 5
    wrong = {finding["code"]: finding for finding in found["findings"] if finding["level"] == "FAIL"}
    assert "K3: it exposes for 40.0 ms, pulses come every 33.3 ms" in wrong["check_exposes_on"]["what"]
    assert "lost" in wrong["check_rehearsed_partly"]["what"]
    assert found["verdict"].startswith("not ready: ")
    assert list((tmp_path / "recordings").iterdir()) == []


@pytest.mark.parametrize(
    ("least", "pulses", "level"),
    [
        (None, (ALL_OK,) * 3, Level.PASS),
        (2, ((OK, ABSENT, OK),) * 3, Level.WARN),
        (None, ((OK, ABSENT, OK),) * 3, Level.FAIL),
        (2, (ALL_OK, (OK, ABSENT, OK), ALL_OK), Level.FAIL),
        (2, ((OK, LOST, OK),) * 3, Level.FAIL),
    ],
    ids=["all", "two are enough", "all are needed", "one comes and goes", "it is there and loses frames"],
)
def test_a_camera_that_is_not_needed_fails_no_rehearsal(
    tmp_path: Path, loopback: Loopback, least: int | None, pulses: tuple[tuple[FrameStatus, ...], ...], level: Level
) -> None:
    write_log(tmp_path / "log.mcap", pulses)
    rig: RigSettings = load_rig(write_rig(tmp_path, "sim", loopback))
    rig = rig.model_copy(update={"trigger": rig.trigger.model_copy(update={"min_cameras": least})})
    first = next(judge_pulses(rig, [], verify(tmp_path / "log.mcap")))
    assert first.level is level, first


@pytest.mark.parametrize(("source", "codes"), [("external", []), ("software", ["check_set_up_only"])])
def test_what_is_good_for_set_up_only_is_called_so(
    tmp_path: Path, loopback: Loopback, source: str, codes: list[str]
) -> None:
    findings = tuple(judge_source(load_rig(write_rig(tmp_path, "aravis", loopback, source=source))))
    assert [finding.code for finding in findings] == codes
    done = Rehearsed(
        pulses=90, complete=90, causes={}, headroom={}, jumps=143, spread_us=None, latency_ms={}, findings=findings
    )
    assert done.verdict == "room for 143 jumps" + (", for set-up only" if codes else "")


def test_the_verdict_is_one_line_of_figures() -> None:
    done = Rehearsed(
        pulses=90, complete=90, causes={}, headroom={"disk": 4.0, "eth1": 2.14}, jumps=143,
        spread_us={"median": 12.2, "max": 30.0}, latency_ms={}, findings=(),
    )  # fmt: skip
    assert done.verdict == "headroom 2.1x (eth1), room for 143 jumps, spread within a pulse 12 us"


def test_cameras_behind_one_port_share_its_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    """By hand: 3 x 640 x 480 px at 30 Hz are 221.2 Mbit/s of pixels; of 9038 bytes on the wire 8964 are pixels."""
    port = Interface("eth1", 9000, 1000, IPv4Network("192.168.0.0/16"), IPv4Address("192.168.0.1"))
    monkeypatch.setattr("svev.rehearsal.interface_to", lambda _: port)
    ((name, times),) = headroom_of(load_rig(CONFIG / "rigs" / "hill-gige.toml"), [])
    assert name == "eth1"
    assert times == pytest.approx(1000 / (221.184 * 9038 / 8964))
