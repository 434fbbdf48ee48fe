import ctypes
import json
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from rig.settings.file import load_rig
from svev import cli
from svev.doctor import examination, machine
from svev.doctor.examination import Probe, run_probe
from svev.doctor.finding import Finding, Level, Topic, passed
from tests.support.loopback import Loopback
from tests.support.rigs import SIM, write_rig
from tests.support.waiting import wait_until


def test_a_probe_that_hangs_is_a_finding() -> None:
    release = threading.Event()

    def hang() -> Iterator[Finding]:
        release.wait()
        yield passed(Topic.DISK, "check_disk_writable", "never told")

    (finding,) = run_probe(Probe("the disk", Topic.DISK, hang, limit_s=0.05))
    release.set()
    wait_until(lambda: not any(t.name == "doctor: the disk" for t in threading.enumerate()), "the probe's thread ended")
    assert finding.level is Level.FAIL
    assert finding.what == "the disk did not answer within 0.05 s"
    assert finding.remedy


def test_a_probe_that_breaks_is_a_finding_and_keeps_what_it_found_before() -> None:
    def halfway() -> Iterator[Finding]:
        yield passed(Topic.DISK, "check_disk_writable", "first half")
        raise RuntimeError("no second half")

    first, second = run_probe(Probe("the disk", Topic.DISK, halfway))
    assert first.what == "first half"
    assert second.level is Level.FAIL
    assert second.what == "the disk cannot be examined: RuntimeError: no second half"


def test_every_probe_gives_findings_with_a_remedy_unless_all_is_well(tmp_path: Path, loopback: Loopback) -> None:
    rig = load_rig(write_rig(tmp_path, loopback))
    for probe in examination.probes(rig, tmp_path):
        for finding in run_probe(probe):
            assert finding.topic is probe.topic
            assert bool(finding.remedy) == (finding.level is not Level.PASS)
            assert "\n" not in finding.what + finding.remedy
            assert "cannot be examined" not in finding.what


def test_another_python_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    assert [finding.level for finding in machine.look_at_python()] == [Level.PASS]
    monkeypatch.setattr(sys, "base_prefix", "/opt/python")
    (finding,) = machine.look_at_python()
    assert finding.level is Level.FAIL
    assert "/usr/bin/python3 -m venv --system-site-packages" in finding.remedy


def test_a_package_that_does_not_load_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "isal.isal_zlib", None)
    missing, others = machine.look_at_packages()
    assert missing.level is Level.FAIL
    assert missing.what.startswith("isal cannot be loaded")
    assert "numpy" in others.what
    assert "isal" not in others.what


def test_a_library_that_the_rig_needs_fails_and_another_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "_LIBDC1394", "libdc1394.so.0")
    iidc = SIM.model_copy(
        update={"cameras": tuple(camera.model_copy(update={"backend": "iidc"}) for camera in SIM.cameras)}
    )
    assert [finding.level for finding in machine.look_at_camera_libraries(SIM)] == [Level.PASS, Level.WARN]
    assert [finding.level for finding in machine.look_at_camera_libraries(iidc)] == [Level.PASS, Level.FAIL]


def test_buffers_that_do_not_fit_fail() -> None:
    assert [finding.level for finding in machine.look_at_memory(SIM)] == [Level.PASS]
    huge = SIM.cameras[0].region.model_copy(update={"width": 4096, "height": 8000})
    camera = SIM.cameras[0].model_copy(update={"region": huge})
    large = SIM.model_copy(
        update={
            "cameras": (camera,) * 8,
            "trigger": SIM.trigger.model_copy(update={"rate_hz": 1000.0}),
        }
    )
    (finding,) = machine.look_at_memory(large)
    assert finding.level is Level.FAIL


def test_the_clock_is_judged_as_the_kernel_judges_it() -> None:
    clock_error = 5  # TIME_ERROR, sys/timex.h: not synchronized, says the return value
    state = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(512))
    (finding,) = machine.look_at_clock()
    assert finding.level is (Level.WARN if state == clock_error else Level.PASS)


def test_a_clock_that_is_years_wrong_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """The battery of the mainboard is empty, and there is no network."""
    monkeypatch.setattr(time, "time", lambda: 946_728_000.0)
    (finding,) = machine.look_at_clock()
    assert (finding.level, finding.code) == (Level.WARN, "check_clock_wrong")
    assert "the clock says 2000-01-01" in finding.what
    assert "sudo date -s" in finding.remedy


def test_the_command_reports_as_json(tmp_path: Path, loopback: Loopback, capsys: pytest.CaptureFixture[str]) -> None:
    code = cli.main(["doctor", "--rig", str(write_rig(tmp_path, loopback)), "--out", str(tmp_path), "--json"])
    result = json.loads(capsys.readouterr().out)
    assert code == (3 if result["counts"]["FAIL"] else 0)
    assert result["rig"] == "examined"
    assert sum(result["counts"].values()) == len(result["findings"])
    assert {finding["topic"] for finding in result["findings"]} == set(Topic)
    assert set(result["findings"][0]) == {"level", "topic", "code", "what", "remedy", "values"}


def test_something_that_fails_ends_the_command_with_3(
    tmp_path: Path, loopback: Loopback, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    path = write_rig(tmp_path, loopback)
    assert cli.main(["doctor", "--rig", str(path), "--out", str(tmp_path / "file" / "recordings")]) == 3
    told = capsys.readouterr().out
    assert "  FAIL  " in told
    assert "-> correct its permissions, or choose another recorder.directory or --out" in told
    assert told.splitlines()[-1].endswith(" FAIL")


def test_without_a_rig_file_it_says_first_what_it_looks_at(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["doctor", "--find"]) in {0, 3}
    first, *_ = capsys.readouterr().err.splitlines()
    assert first.startswith("no --rig is given: looking at the computer for ")
    assert "hill-gige.toml" in first


def test_a_wrong_rig_file_ends_with_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["doctor", "--rig", str(tmp_path / "none.toml")]) == 2
    assert capsys.readouterr().err.startswith(f"svev: {tmp_path / 'none.toml'}: no such file")
