"""Reasons why a camera is not found, and libdc1394's messages in our log."""

import logging
import re
import subprocess
import sys
from pathlib import Path

import pytest

from capture.iidc.bus import Bus, why_no_camera
from capture.iidc.device import Device
from capture.iidc.library import Dc1394Error
from rig.errors import CameraNotFoundError
from tests.capture.iidc.emulated import GUIDS, emulated_bus

NOT_LOADED = """
from capture.iidc import library
library.SONAME = "libdc1394.so.0"
library.load()
"""


def test_a_missing_library_says_what_to_install() -> None:
    done = subprocess.run([sys.executable, "-c", NOT_LOADED], capture_output=True, text=True, check=False, timeout=60)
    assert "BadInputError: FireWire cameras need libdc1394, which cannot be loaded" in done.stderr
    assert "run: sudo apt-get install libdc1394-25" in done.stderr


def test_without_a_firewire_port(tmp_path: Path) -> None:
    (tmp_path / "fwupd").touch()
    assert "no FireWire port that the kernel drives" in why_no_camera(tmp_path)


def test_without_the_right_to_the_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for number in (0, 1):
        (tmp_path / f"fw{number}").touch()
    monkeypatch.setattr("os.access", lambda path, _: path.name == "fw0")  # root may open every file
    assert f"no right to use the FireWire devices {tmp_path}/fw1: run: sudo usermod" in why_no_camera(tmp_path)


def test_with_a_port_and_no_camera(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On many systems only root may open the card itself, which svev does not need."""
    (tmp_path / "fw0").touch()
    card = tmp_path / "sysfs" / "fw0"
    card.mkdir(parents=True)
    (card / "is_local").write_text("1\n")
    monkeypatch.setattr("os.access", lambda _path, _mode: False)
    assert "no FireWire camera answers: check its power and cable" in why_no_camera(tmp_path, tmp_path / "sysfs")
    (card / "is_local").write_text("0\n")
    assert "no right to use the FireWire devices" in why_no_camera(tmp_path, tmp_path / "sysfs")


def test_a_wrong_guid_is_told_the_right_ones() -> None:
    expected = f"no FireWire camera with GUID 0000000000000005, but {GUIDS['K1']}, {GUIDS['K2']}: correct the address"
    with emulated_bus("K1", "K2"), Bus() as bus:
        assert {camera.guid for camera in bus.cameras()} == {int(GUIDS[name], 16) for name in ("K1", "K2")}
        with pytest.raises(CameraNotFoundError, match=re.escape(expected)):
            bus.find(5)


def test_a_refused_call_names_function_and_reason_and_libdc1394_speaks_in_our_log(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.DEBUG, "svev.libdc1394")
    with emulated_bus("K1") as hill, Bus() as bus, Device(bus, bus.find(int(GUIDS["K1"], 16))) as device:
        assert device.name == f"AVT Marlin F080B, GUID {GUIDS['K1']}"
        with pytest.raises(Dc1394Error, match=r"dc1394_video_set_iso_speed: .*\(-\d+\b") as caught:
            device.call("video_set_iso_speed", 99)
        assert caught.value.code < 0
        hill.kill("K1")
        with pytest.raises(Dc1394Error, match=r"juju: .*No such device"):
            device.transmits()
    assert any("Juju: Opened /dev/fw" in record.message for record in caplog.records)
    assert any(record.levelno == logging.WARNING for record in caplog.records)
