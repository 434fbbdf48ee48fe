"""`svev cameras` with simulated cameras: they are found by broadcast, moved to another address, and keep it."""

import json
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from rig.errors import BadInputError
from rig.settings.file import CONFIG, load_rig
from simrig.gige.registers.makers import Maker
from simrig.programs.simulated_hill import SimulatedHill
from svev.commands.computer import cameras
from svev.gige.gvcp import find_cameras
from tests.capture.aravis.test_makers import make
from tests.simrig.gige.raw_client import CCP, GvcpClient
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig

_CURRENT_CONFIGURATION, _PERSISTENT_ADDRESS, _PERSISTENT_BIT = 0x0014, 0x064C, 1
_CONTROL = 2


def _cameras(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return run_svev("cameras", *arguments)


def _answer(*arguments: str) -> Any:
    done = _cameras(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture
def addresses(loopback: Loopback) -> Iterator[tuple[str, str, str]]:
    """Addresses of two running cameras, and one that nobody has."""
    left, right, free = loopback.cameras(3)
    names, scenario = {"K1": left, "K2": right}, CONFIG / "scenarios" / "training.toml"
    with SimulatedHill(scenario, names, 30.0, test_pattern=True, broadcast="127.255.255.255"):
        yield left, right, free


def test_a_camera_is_found_and_takes_an_address(addresses: tuple[str, str, str]) -> None:
    left, right, free = addresses
    # Other tests' cameras answer, too.
    found = {each["address"]: each for each in _answer("list", "--interface", "lo")["cameras"]}
    assert {left, right} <= set(found)
    camera = found[left]
    assert (camera["vendor"], camera["name"], camera["interface"], camera["reachable"]) == ("Svev", "K1", "lo", True)

    moved = _answer("set-ip", camera["mac"], free, "--interface", "lo")

    assert (moved["address"], moved["serial"], moved["kept"]) == (free, camera["serial"], True)
    features = {each["name"]: each for each in _answer("show", free)["features"]}
    exposure = features["ExposureTime"]
    assert (exposure["unit"], exposure["allowed"]) == ("us", "10.0 to 1000000.0")
    assert "Line1" in features["TriggerSource"]["allowed"]
    with GvcpClient(free) as client:
        assert client.read(_CURRENT_CONFIGURATION) & _PERSISTENT_BIT
        assert client.read(_PERSISTENT_ADDRESS).to_bytes(4, "big") == bytes(map(int, free.split(".")))
    assert _cameras("show", left).returncode == 2


def test_a_camera_in_use_and_addresses_that_do_not_fit_are_refused(addresses: tuple[str, str, str]) -> None:
    left, right, free = addresses
    with GvcpClient(left) as client:
        assert client.write(CCP, _CONTROL) == 0
        done = _cameras("set-ip", left, free, "--interface", "lo")
        assert (done.returncode, "has not taken the address" in done.stderr) == (5, True)
    refused = {"192.168.77.5": "in the subnet 127.0.0.0/8", right: "is the address of camera", "K1": "no IPv4"}
    for wanted, words in refused.items():
        done = _cameras("set-ip", left, wanted, "--interface", "lo")
        assert (done.returncode, words in done.stderr) == (2, True), done.stderr


def test_of_cameras_with_one_serial_number_each_is_named_by_its_mac_address(
    addresses: tuple[str, str, str],
) -> None:
    left, right, _ = addresses
    both = [replace(each, camera=replace(each.camera, serial="0815"))
            for each in find_cameras("lo") if each.camera.address in {left, right}]  # fmt: skip
    macs = [each.camera.mac for each in both]
    with pytest.raises(BadInputError) as refused:
        cameras._choose("0815", both)
    said = str(refused.value)
    assert "0815: 2 cameras have it" in said
    assert said.endswith("give the MAC address of one")
    assert all(f"{mac} serial 0815 at " in said for mac in macs)
    assert [cameras._choose(mac, both).camera.mac for mac in macs] == macs
    with pytest.raises(BadInputError, match="0816: no camera found by this"):
        cameras._choose("0816", both)


def test_cameras_that_answer_no_broadcast_are_found_by_the_rig_file(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, loopback, simulated=False)
    names = {camera.name: camera.address for camera in load_rig(rig).cameras[:2]}
    with SimulatedHill(CONFIG / "scenarios" / "training.toml", names, 30.0, test_pattern=True):
        done = _cameras("list", "--interface", "none0", "--rig", str(rig))
        found = _answer("list", "--interface", "none0", "--rig", str(rig))["cameras"]
    lines = done.stdout.splitlines()
    assert len(lines) == 2
    assert all(line.endswith("found by the rig file's address: it does not answer broadcasts here") for line in lines)
    assert [each["address"] for each in found] == list(names.values())
    assert all(each["asked"] and each["reachable"] for each in found)


def test_names_may_hold_any_bytes(tmp_path: Path, loopback: Loopback) -> None:
    with make(Maker.STANDARD, tmp_path, loopback) as made:
        made.registers.set("DeviceUserID", "Sk\udce5d")  # Latin-1
        made.registers.set("DeviceModelName", "\udcff\udcfe1")
        there = {each["name"]: each for each in _answer("show", made.rig.cameras[0].address)["features"]}
        assert there["DeviceUserID"]["value"] == "Sk\ufffdd"
        with made.opened() as camera:
            assert camera.description.startswith("Svev \ufffd\ufffd1 serial SIM-")
