import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from rig.rigfile import CONFIG, load_rig
from simrig.simulated_hill import SimulatedHill
from svev.doctor import cameras
from svev.doctor.finding import Level
from svev.doctor.gvcp import ask_camera
from tests.support.loopback import Loopback
from tests.support.rigs import SIM, write_rig


@contextmanager
def _somebody(address: str, answer: bytes | None) -> Iterator[None]:
    """Somebody who sits at a camera's port and says `answer` to everything, or nothing at all."""
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
    findings = list(cameras.look_at_cameras(rig))
    assert [finding.level for finding in findings] == [Level.FAIL] * 3
    expected = [f"K{i} at {address} does not answer" for i, address in enumerate(loopback.cameras(3), start=1)]
    assert [finding.what for finding in findings] == expected


def test_a_camera_says_who_it_is_and_whether_somebody_controls_it(tmp_path: Path, loopback: Loopback) -> None:
    rig = load_rig(write_rig(tmp_path, loopback, simulated=False))
    names = {camera.name: camera.address for camera in rig.cameras}
    with SimulatedHill(CONFIG / "scenarios" / "training.toml", names, 30.0, test_pattern=True):
        findings = list(cameras.look_at_cameras(rig))
        assert [finding.level for finding in findings] == [Level.PASS] * 3
        assert all("serial" in finding.what for finding in findings)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.settimeout(2.0)
            take_control = struct.pack(">BBHHHII", 0x42, 1, 0x0082, 8, 1, 0x0A00, 2)
            other.sendto(take_control, (rig.cameras[1].address, 3956))
            assert other.recv(1024)[:4] == b"\0\0\0\x83"
            taken = list(cameras.look_at_cameras(rig))
    assert [finding.level for finding in taken] == [Level.PASS, Level.FAIL, Level.PASS]
    assert "is controlled by another program" in taken[1].what


def test_an_address_of_a_simulated_camera_must_be_free(tmp_path: Path, loopback: Loopback) -> None:
    rig = load_rig(write_rig(tmp_path, loopback))
    assert [finding.level for finding in cameras.look_at_cameras(rig)] == [Level.PASS] * 3
    with _somebody(loopback.cameras(2)[1], None):
        taken = list(cameras.look_at_cameras(rig))
    assert [finding.level for finding in taken] == [Level.PASS, Level.FAIL, Level.PASS]
    assert "Address already in use" in taken[1].what


def test_cameras_inside_the_program_are_said_to_be_so() -> None:
    findings = list(cameras.look_at_cameras(SIM))
    assert [finding.what for finding in findings] == [f"K{i} is simulated inside the program" for i in (1, 2, 3)]
    assert list(cameras.look_for_cameras(SIM)) == []


def test_a_back_end_that_does_not_exist_yet_fails() -> None:
    rig = load_rig(CONFIG / "rigs" / "hill-gige.toml")
    replayed = tuple(camera.model_copy(update={"backend": "replay"}) for camera in rig.cameras)
    findings = list(cameras.look_at_cameras(rig.model_copy(update={"cameras": replayed})))
    assert [finding.level for finding in findings] == [Level.FAIL] * 3


def test_aravis_looks_for_cameras_and_leaves_nothing_open(tmp_path: Path, loopback: Loopback) -> None:
    (finding,) = cameras.look_for_cameras(load_rig(write_rig(tmp_path, loopback, simulated=False)))
    assert finding.level is Level.PASS
    assert finding.what.startswith("found on the network: ")
