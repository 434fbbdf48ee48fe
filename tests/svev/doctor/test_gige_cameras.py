import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from ipaddress import IPv4Network
from pathlib import Path

import pytest

from rig.host.interfaces import Interface
from rig.settings.camera import Region
from rig.settings.file import CONFIG, load_rig
from simrig.programs.simulated_hill import SimulatedHill
from svev.doctor.cameras import gige
from svev.doctor.finding import Level
from svev.gige.gvcp import FoundCamera, GigeCamera, ask_camera
from tests.capture.rigs import make_rig
from tests.recorder.logs import write_log
from tests.support.loopback import Loopback
from tests.support.rigs import SIM, write_rig


@contextmanager
def _somebody(address: str, answer: bytes | None) -> Iterator[None]:
    """A socket at a camera's port that sends `answer` to every request, or nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sitting:
        sitting.bind((address, 3956))

        def talk() -> None:
            while True:
                request, peer = sitting.recvfrom(1024)
                if not request:
                    return
                if answer is not None:
                    sitting.sendto(answer, peer)

        thread = threading.Thread(target=talk)
        thread.start()
        try:
            yield
        finally:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as last:
                last.sendto(b"", (address, 3956))
            thread.join()


def test_nobody_is_there(loopback: Loopback) -> None:
    assert ask_camera(loopback.cameras(1)[0], 0.3) is None


def test_somebody_who_is_silent_does_not_hold_us_up(loopback: Loopback) -> None:
    with _somebody(loopback.cameras(1)[0], None):
        assert ask_camera(loopback.cameras(1)[0], 0.3) is None


def test_a_stranger_is_not_taken_for_a_camera(loopback: Loopback) -> None:
    with _somebody(loopback.cameras(1)[0], b"\0\0\0\3\0\4\0\1abcd"), pytest.raises(ValueError, match="4 bytes, 248"):
        ask_camera(loopback.cameras(1)[0], 0.3)


def test_cameras_that_do_not_answer_are_named_one_by_one(tmp_path: Path, loopback: Loopback) -> None:
    rig = load_rig(write_rig(tmp_path, loopback, simulated=False))
    findings = list(gige.look_at_cameras(rig))
    assert [finding.level for finding in findings] == [Level.FAIL] * 3
    expected = [f"K{i} at {address} does not answer" for i, address in enumerate(loopback.cameras(3), start=1)]
    assert [finding.what for finding in findings] == expected


def test_a_camera_says_who_it_is_and_whether_somebody_controls_it(tmp_path: Path, loopback: Loopback) -> None:
    rig = load_rig(write_rig(tmp_path, loopback, simulated=False))
    names = {camera.name: camera.address for camera in rig.cameras}
    with SimulatedHill(CONFIG / "scenarios" / "training.toml", names, 30.0, test_pattern=True):
        findings = list(gige.look_at_cameras(rig))
        codes = ["check_answers", "check_packets"] * 3 + ["check_would_be_taken"] * 3
        assert [finding.code for finding in findings] == codes
        assert {finding.level for finding in findings} == {Level.PASS}
        assert all("serial" in finding.what for finding in findings[:6:2])
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.settimeout(2.0)
            take_control = struct.pack(">BBHHHII", 0x42, 1, 0x0082, 8, 1, 0x0A00, 2)
            other.sendto(take_control, (rig.cameras[1].address, 3956))
            assert other.recv(1024)[:4] == b"\0\0\0\x83"
            taken = list(gige.look_at_cameras(rig))
    # nobody takes control from the other program
    codes = ["check_answers", "check_packets", "check_controlled", "check_answers", "check_packets"]
    assert [finding.code for finding in taken] == codes + ["check_would_be_taken"] * 2
    assert "is controlled by another program" in taken[2].what


def test_an_address_of_a_simulated_camera_must_be_free(tmp_path: Path, loopback: Loopback) -> None:
    rig = load_rig(write_rig(tmp_path, loopback))
    assert [finding.level for finding in gige.look_at_cameras(rig)] == [Level.PASS] * 3
    with _somebody(loopback.cameras(2)[1], None):
        taken = list(gige.look_at_cameras(rig))
    assert [finding.level for finding in taken] == [Level.PASS, Level.FAIL, Level.PASS]
    assert "Address already in use" in taken[1].what


def test_cameras_inside_the_program_are_said_to_be_so() -> None:
    findings = list(gige.look_at_cameras(SIM))
    assert [finding.what for finding in findings] == [f"K{i} is simulated inside the program" for i in (1, 2, 3)]
    assert list(gige.look_for_cameras(SIM)) == []


def test_a_log_that_fits_the_rig_file_passes_and_another_fails(tmp_path: Path, loopback: Loopback) -> None:
    log = tmp_path / "log.mcap"
    write_log(log)
    rig = make_rig(tmp_path, "replay", loopback, log=log)
    (wrong,) = gige.look_at_cameras(rig)
    assert wrong.level is Level.FAIL
    assert "write region = { width = 30, height = 24 }" in wrong.what
    fitting = tuple(c.model_copy(update={"region": Region(width=30, height=24)}) for c in rig.cameras)
    (right,) = gige.look_at_cameras(rig.model_copy(update={"cameras": fitting}))
    assert right.level is Level.PASS
    assert right.what == f"K1, K2, K3 are replayed from {log}"


def test_without_cameras_the_search_warns_and_leaves_nothing_open(tmp_path: Path, loopback: Loopback) -> None:
    rig = load_rig(write_rig(tmp_path, loopback, simulated=False))
    for finding in gige.look_for_cameras(rig):  # on a developer's network there may be some
        assert finding.level in {Level.PASS, Level.WARN}
        assert "found behind" in finding.what or "no camera answers" in finding.what


@pytest.mark.parametrize(
    ("address", "reachable", "level", "words"),
    [
        ("192.168.11.2", True, Level.PASS, "K1 of the rig file"),
        ("192.168.11.3", True, Level.PASS, "not in the rig file"),
        ("169.254.3.4", False, Level.WARN, "not in the subnet 192.168.11.0/24"),
    ],
)
def test_a_camera_that_is_found_is_compared_with_the_rig_file(
    address: str, reachable: bool, level: Level, words: str
) -> None:
    network = IPv4Network("192.168.11.0/24")
    port = Interface("eth1", mtu=9000, speed_mbps=1000, network=network, address=network[1])
    camera = GigeCamera("Maker", "Fast", "42", "left", "00:0f:31:01:02:03", address, "255.255.255.0")
    finding = gige.judge_found(FoundCamera(camera, port, reachable), {"192.168.11.2": "K1"})
    assert (finding.level, words in finding.what) == (level, True)
    assert reachable or "svev cameras set-ip 00:0f:31:01:02:03 ADDRESS" in finding.remedy


def test_cameras_that_share_an_address_are_named_by_what_only_one_has() -> None:
    """As they leave the box: one address, and of some makers one serial number."""
    network = IPv4Network("192.168.11.0/24")
    port = Interface("eth1", mtu=9000, speed_mbps=1000, network=network, address=network[1])
    camera = GigeCamera("Maker", "Fast", "42", "left", "00:0f:31:01:02:03", "192.168.11.2", "255.255.255.0")
    finding = gige.judge_found(FoundCamera(camera, port, reachable=True), {"192.168.11.2": "K1"}, alone=False)
    assert finding.level is Level.WARN
    assert "an address that another camera has too" in finding.what
    assert "svev cameras set-ip 00:0f:31:01:02:03 ADDRESS" in finding.remedy
