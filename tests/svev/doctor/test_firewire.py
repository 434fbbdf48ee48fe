"""The doctor examines and tries FireWire cameras on the emulated bus."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from rig.pulse import HillPulse
from rig.settings.file import CONFIG, load_rig
from rig.settings.model import RigSettings
from simrig.programs.simulated_hill import SimulatedHill
from simrig.world.faults import Fault, FaultKind
from svev import cli
from svev.doctor.cameras import firewire, firewire_cameras
from svev.doctor.finding import Finding, Level

RIG = load_rig(CONFIG / "rigs" / "hill-iidc.toml")
SCENARIO = CONFIG / "scenarios" / "training.toml"


def one_camera(**changes: Any) -> RigSettings:
    camera = RIG.cameras[0].model_copy(update=changes)
    return RIG.model_copy(update={"cameras": (camera,)})


@contextmanager
def bus(rig: RigSettings, **options: Any) -> Iterator[SimulatedHill]:
    cameras = {camera.name: camera.address for camera in rig.cameras}
    with SimulatedHill(SCENARIO, {}, rig.trigger.rate_hz, firewire=cameras, **options) as hill:
        yield hill


def ask(rig: RigSettings, hill: SimulatedHill, *, trial: bool) -> list[Finding]:
    return list(firewire._ask(rig, hill.environment, trial=trial))


def worst(findings: list[Finding]) -> list[tuple[Level, str, str]]:
    """All that is not in order, but for the delay of the first packet: the emulated bus is as late as this computer."""
    wrong = [found for found in findings if found.level is not Level.PASS and found.code != "check_trial_delay"]
    return [(found.level, found.what, found.remedy) for found in wrong]


def test_a_trial_of_cameras_that_are_in_order_finds_nothing_wrong() -> None:
    rig = one_camera()
    with bus(rig) as hill:
        findings = ask(rig, hill, trial=True)
    assert worst(findings) == []
    text = "\n".join(finding.what for finding in findings)
    for word in (
        "bandwidth: 1292 of 4915 units",
        "K1 is AVT Marlin F080B, GUID 000a4701011b0001",
        "can sign its frames",
        "K1 is triggered ",
        "none lost or damaged",
        "big end of each word first",
        "trigger and frame counter run together",
        "after the signed time, 2.50 ms expected",
        "goes on after a bus reset",
    ):
        assert word in text


def test_a_look_changes_nothing_and_sees_who_is_there() -> None:
    with bus(RIG) as hill:
        before = hill.bus_state()
        findings = ask(one_camera(), hill, trial=False)
        assert hill.bus_state() == before
    assert worst(findings) == []
    assert any("not in the rig file: 000a4701011b0002, 000a4701011b0003" in finding.what for finding in findings)


def test_without_signature_it_warns() -> None:
    rig = one_camera()
    with bus(rig, signature="none") as hill:
        ((level, what, _),) = worst(ask(rig, hill, trial=True))
    assert level is Level.WARN
    assert "K1 cannot sign its frames" in what


def test_without_the_right_to_the_device_it_says_how_to_get_it() -> None:
    rig = one_camera()
    with bus(rig, permitted=False) as hill:
        ((level, what, remedy),) = worst(ask(rig, hill, trial=True))
    assert level is Level.FAIL
    assert "no right to use the FireWire devices /dev/fw" in what
    assert "usermod -aG video" in remedy


def test_a_camera_that_is_not_there_is_told_from_no_camera_at_all() -> None:
    with bus(one_camera()) as hill:
        ((level, what, remedy),) = worst(ask(one_camera(address="000a4701011b0007"), hill, trial=True))
        assert level is Level.FAIL
        assert "K1, no FireWire camera with GUID 000a4701011b0007, but 000a4701011b0001" in what
        assert remedy.startswith("correct the address in the rig file")
        hill.kill("K1")
        ((level, what, remedy),) = worst(ask(one_camera(), hill, trial=True))
    assert level is Level.FAIL
    assert what == "no FireWire camera answers"
    assert remedy.startswith("check its power and cable")


def test_without_pulses_it_says_where_to_look(tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(f'base = "{SCENARIO}"\nname = "test"\npauses = [[0, 100000]]\n')
    rig = one_camera()
    with SimulatedHill(scenario, {}, 30.0, firewire={"K1": rig.cameras[0].address}) as hill:
        ((level, what, remedy),) = worst(ask(rig, hill, trial=True))
    assert (level, what) == (Level.WARN, "K1 is set up, but no frame came in 2 s")
    assert "pulse generator" in remedy


def test_lost_packets_and_overruns_are_found() -> None:
    """Faults come at every tenth pulse: some of them fall into the two seconds."""
    rig = one_camera()
    with bus(rig) as hill:
        now = hill.train.next_index(hill.train.time(HillPulse(0)))
        for pulse in range(now + 10, now + 2000, 20):
            hill.inject(Fault(kind=FaultKind.OVERRUN, camera="K1", at_pulse=pulse))
            hill.inject(Fault(kind=FaultKind.LOST_PACKETS, camera="K1", at_pulse=pulse + 10, packets=(50,)))
        found = worst(ask(rig, hill, trial=True))
    assert [level for level, _, _ in found] == [Level.WARN, Level.WARN]
    assert "came damaged" in found[0][1]
    assert "came while it was busy (overrun)" in found[1][1]


def test_an_exposure_longer_than_the_period_cannot_work() -> None:
    finding = firewire_cameras._look_at_exposure(one_camera(exposure_us=33_000.0).cameras[0], RIG)
    assert finding.level is Level.FAIL
    assert "every other pulse will find it exposing" in finding.what
    finding = firewire_cameras._look_at_exposure(one_camera(exposure_us=5_000.0).cameras[0], RIG)
    assert finding.level is Level.WARN


def test_four_marlins_on_one_bus_fail() -> None:
    fourth = RIG.cameras[2].model_copy(update={"name": "K4", "address": "000a4701011b0004"})
    rig = RIG.model_copy(update={"cameras": (*RIG.cameras, fourth)})
    finding = firewire_cameras._look_at_bandwidth(rig, list(rig.cameras))
    assert finding.level is Level.FAIL
    assert "need 5168 of its 4915 bandwidth units" in finding.what + finding.remedy


def test_the_command_starts_the_emulated_bus_of_a_simulated_rig() -> None:
    rig = CONFIG / "rigs" / "sim-firewire.toml"
    done = CliRunner().invoke(cli.command_line(), ["doctor", "--bus", "firewire", "--rig", str(rig), "--json"])
    report = json.loads(done.stdout[done.stdout.index("{") :])
    assert (done.exit_code, report["counts"]["FAIL"]) == (0, 0), done.stdout
    assert {"K1", "K2", "K3"} == {f["what"][:2] for f in report["findings"] if "goes on after a bus reset" in f["what"]}


def test_the_command_refuses_a_rig_without_firewire() -> None:
    rig = CONFIG / "rigs" / "hill-gige.toml"
    done = CliRunner().invoke(cli.command_line(), ["doctor", "--bus", "firewire", "--rig", str(rig)])
    assert done.exit_code == 3
    assert "has no FireWire camera" in done.stdout


def test_a_bus_that_hangs_does_not_hang_the_doctor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(firewire, "LOOK_S", 0.0)
    ((level, what, remedy),) = worst(list(firewire._ask(one_camera(), {}, trial=False)))
    assert (level, what) == (Level.FAIL, "the FireWire bus did not answer within 0 s")
    assert "cables out and in" in remedy


def test_an_examination_that_fails_is_reported_by_the_last_line_that_it_wrote() -> None:
    ((level, what, _),) = worst(list(firewire._ask(one_camera(), {"PYTHONHOME": "/nowhere"}, trial=False)))
    assert level is Level.FAIL
    assert what.startswith("FireWire cannot be examined: ")
    assert "no reason given" not in what


@pytest.mark.hardware
def test_real_cameras_are_in_order() -> None:
    assert worst(list(firewire.try_firewire(RIG))) == []
