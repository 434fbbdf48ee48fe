"""The files that `svev setup` makes: their own readers take them, and what was not asked about is still there."""

import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from rig.errors import BadInputError
from rig.settings.file import CONFIG, load_rig
from rig.settings.trigger import TriggerBoxTrigger
from simrig.firewire.host.build import shim
from simrig.programs.simulated_hill import SimulatedHill
from svev.serving.certificates import CertificateFiles
from svev.setup.answers import Answers, CameraAnswer, Source, Today
from svev.setup.places import Places
from svev.setup.rig_text import rig_text
from svev.setup.writing import write
from tests.capture.rigs import guids
from tests.support.commands import run_svev
from tests.svev.setup.test_questions import SCENARIO

K1, K2 = CameraAnswer("K1", "aravis", "192.168.11.2"), CameraAnswer("K2", "aravis", "192.168.12.2", (1920, 1200))


def answers(folder: Path, **changed: object) -> Answers:
    """Answers of somebody who takes what is usual."""
    made = Answers(
        language="en", name="hill", cameras=(K1, K2), source="external", rate_hz=30.0, input="Line1", port=None,
        line=None, survey=None, recordings=folder / "recordings", phones=True, names=("hillpc.local",), https=True,
    )  # fmt: skip
    return replace(made, **changed)  # type: ignore[arg-type]


@pytest.mark.parametrize("name", sorted(path.name for path in (CONFIG / "rigs").glob("*.toml")))
@pytest.mark.parametrize("source", ["external", "triggerbox", "gpio", "action", "software"])
def test_every_rig_file_takes_the_answers(tmp_path: Path, name: str, source: Source) -> None:
    """From each rig file that is shipped, whatever its trigger and cameras were before."""
    port, line = ("/dev/ttyUSB3" if source == "triggerbox" else None), ("17" if source == "gpio" else None)
    before = (CONFIG / "rigs" / name).read_text()
    text = rig_text(before, answers(tmp_path, source=source, port=port, line=line, packet_size=1500))
    path = tmp_path / "rig.toml"
    path.write_text(text)
    rig = load_rig(path)
    assert [camera.name for camera in rig.cameras] == ["K1", "K2"]
    assert {camera.trigger_input for camera in rig.cameras} == {"Line1"}
    assert (rig.trigger.source, rig.network.packet_size, rig.simulation) == (source, 1500, None)
    if source == "triggerbox":
        assert isinstance(rig.trigger, TriggerBoxTrigger)
        assert rig.trigger.port == port
    comments = [line for line in before.splitlines() if line.startswith("#")]
    assert set(comments) <= set(text.splitlines())


def test_a_camera_that_stays_keeps_its_settings_and_a_new_one_has_its_whole_sensor(tmp_path: Path) -> None:
    before = (CONFIG / "rigs" / "hill-gige.toml").read_text().replace("exposure_us = 1000", "exposure_us = 777", 1)
    new = CameraAnswer("left", "aravis", "192.168.10.2", (1920, 1200))
    path = tmp_path / "rig.toml"
    path.write_text(rig_text(before, answers(tmp_path, cameras=(new, K1))))
    left, right = load_rig(path).cameras
    assert (left.name, left.region.width, left.region.height) == ("left", 1920, 1200)
    assert (right.name, right.exposure_us, right.region.width) == ("K1", 777, 640)


def test_the_service_is_told_of_a_folder_on_another_disk(tmp_path: Path) -> None:
    places = Places(tmp_path / "etc", tmp_path / "units", tmp_path / "state")
    disk = tmp_path / "disk" / "jumps"
    write(answers(tmp_path, recordings=disk), Today.of(places.folder), places)
    drop_in = (tmp_path / "units" / "svev.service.d" / "recordings.conf").read_text()
    assert f"\nRequiresMountsFor={disk}\n" in drop_in
    assert f"\nReadWritePaths={disk}\n" in drop_in
    assert disk.is_dir()
    inside = Places(tmp_path / "etc2", tmp_path / "units2", tmp_path / "state")
    write(answers(tmp_path, recordings=tmp_path / "state" / "recordings"), Today.of(inside.folder), inside)
    assert not (tmp_path / "units2").exists()


def test_a_file_that_is_renewed_keeps_its_rights(tmp_path: Path) -> None:
    write(answers(tmp_path, phones=False), Today.of(tmp_path), Places(tmp_path))
    (tmp_path / "rig.toml").chmod(0o604)
    write(answers(tmp_path, phones=False, name="new"), Today.of(tmp_path), Places(tmp_path))
    assert (tmp_path / "rig.toml").stat().st_mode & 0o777 == 0o604


def test_phones_need_nothing_new_while_the_names_are_the_same(tmp_path: Path) -> None:
    places, files = Places(tmp_path), CertificateFiles.within(tmp_path / "tls")
    first = write(answers(tmp_path), Today.of(tmp_path), places)
    authority, token = files.authority.read_bytes(), (tmp_path / "token").read_text()
    assert first.token == token.strip()
    again = write(answers(tmp_path, rate_hz=25.0), Today.of(tmp_path), places)
    assert (again.token, again.authority) == ("", files.authority)
    assert [path.name for path in again.written] == ["rig.toml"]
    files.certificate.unlink()
    write(answers(tmp_path), Today.of(tmp_path), places)  # lost: the same authority signs a new one
    assert (files.authority.read_bytes(), files.certificate.exists()) == (authority, True)
    other = write(answers(tmp_path, names=("other.local",)), Today.of(tmp_path), places)
    assert files.authority in other.written
    assert files.authority.read_bytes() != authority
    assert (tmp_path / "token").read_text() == token


def test_a_file_that_cannot_be_written_leaves_the_others_as_they_were(tmp_path: Path) -> None:
    write(answers(tmp_path, phones=False), Today.of(tmp_path), Places(tmp_path))
    (tmp_path / "tls").write_text("in the way")
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    with pytest.raises(BadInputError, match="cannot be written"):
        write(answers(tmp_path, name="another"), Today.of(tmp_path), Places(tmp_path))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


@pytest.mark.skipif(shutil.which("cc") is None, reason="the emulated bus needs a C compiler")
def test_firewire_cameras_are_found_and_shown(tmp_path: Path) -> None:
    assert shim().exists()
    (left, right) = guids(2)
    with SimulatedHill(SCENARIO, {}, 30.0, firewire={"K1": left, "K2": right}) as hill:
        done = run_svev(
            "setup", "--folder", str(tmp_path / "hill"), "--network", "192.0.2.0/24", "--no-phones", "--yes",
            "--no-rehearse",
            environment=hill.environment,
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "no picture" not in done.stdout, done.stdout
    rig = load_rig(tmp_path / "hill" / "rig.toml")
    assert [(camera.backend, camera.address) for camera in rig.cameras] == [("iidc", left), ("iidc", right)]


def test_the_folder_is_that_of_the_service_for_root_alone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert Places.of(None) == Places(tmp_path / "svev-hill")
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    assert Places.of(None).recordings == Path("/var/lib/svev/recordings")
