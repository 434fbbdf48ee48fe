import os
import socket
import subprocess
import sys
from ipaddress import IPv4Address, IPv4Network
from pathlib import Path

import pytest
import zmq

from recorder.publishing.keys import make_keys
from rig.host.interfaces import Interface, interface_to
from rig.settings.file import CONFIG, load_rig
from rig.settings.model import RigSettings
from svev.doctor import network
from svev.doctor.finding import Level
from tests.support.loopback import Loopback
from tests.support.rigs import SIM, rig_with, write_rig

HILL = load_rig(CONFIG / "rigs" / "hill-gige.toml")
PORT = Interface("eth1", 9000, 1000, IPv4Network("192.168.11.0/24"), IPv4Address("192.168.11.1"))


def _fast(rig: RigSettings) -> RigSettings:
    """The rig with a pulse rate at which plain sockets are too slow."""
    return rig.model_copy(update={"trigger": rig.trigger.model_copy(update={"rate_hz": 500.0})})


def test_the_way_to_an_address_is_found(loopback: Loopback) -> None:
    interface = interface_to(loopback.cameras(1)[0])
    assert interface is not None
    assert interface.name == "lo"
    assert interface.mtu == int(Path("/sys/class/net/lo/mtu").read_text())


def test_a_name_that_is_no_address_fails(tmp_path: Path, loopback: Loopback) -> None:
    rig = rig_with(tmp_path, loopback)
    wrong = rig.cameras[0].model_copy(update={"address": "192.168.11"})
    findings = list(network.look_at_interfaces(rig.model_copy(update={"cameras": (wrong,)})))
    assert [(finding.level, finding.what) for finding in findings] == [
        (Level.FAIL, "K1: 192.168.11 is no IPv4 address")
    ]


def test_a_good_port_passes() -> None:
    assert network.judge_interface(HILL, PORT, [HILL.cameras[0]]).level is Level.PASS


def test_packets_that_do_not_fit_fail() -> None:
    finding = network.judge_interface(
        HILL, Interface("eth1", 1500, 1000, PORT.network, PORT.address), [HILL.cameras[0]]
    )
    assert finding.level is Level.FAIL
    assert "sudo ip link set eth1 mtu 9000" in finding.remedy


def test_a_link_that_is_too_slow_fails() -> None:
    # 640 x 480 x 8 bit x 30 Hz = 74 Mbit/s each
    slow = Interface("eth1", 9000, 100, PORT.network, PORT.address)
    assert network.judge_interface(HILL, slow, [HILL.cameras[0]]).level is Level.PASS
    finding = network.judge_interface(HILL, slow, [HILL.cameras[0], HILL.cameras[0]])
    assert finding.level is Level.FAIL
    assert "the frames are 147 Mbit/s" in finding.what


def test_a_camera_in_another_subnet_is_a_warning() -> None:
    assert network.judge_interface(HILL, PORT, [HILL.cameras[1]]).level is Level.WARN


def test_socket_buffers_are_judged_by_what_the_kernel_says(tmp_path: Path, loopback: Loopback) -> None:
    rig = rig_with(tmp_path, loopback, packet_socket="off")
    limit, value = 8 * 640 * 480, int(Path("/proc/sys/net/core/rmem_max").read_text())
    (finding,) = network.look_at_socket_buffers(rig)
    assert finding.level is (Level.PASS if value >= limit else Level.WARN)
    assert f"net.core.rmem_max is {value}" in finding.what
    assert value >= limit or f"sudo sysctl -w net.core.rmem_max={limit}" in finding.remedy


def test_for_larger_frames_no_larger_buffer_is_wanted_than_is_asked_for(tmp_path: Path, loopback: Loopback) -> None:
    rig = rig_with(tmp_path, loopback, packet_socket="off")
    large = rig.cameras[0].model_copy(
        update={"region": rig.cameras[0].region.model_copy(update={"width": 16384, "height": 16384})}
    )
    (finding,) = network.look_at_socket_buffers(rig.model_copy(update={"cameras": (large,)}))
    assert "is wanted" not in finding.what or "8388608 is wanted" in finding.what


def test_without_network_cameras_there_is_nothing_to_say() -> None:
    assert list(network.look_at_socket_buffers(SIM)) == []
    assert list(network.look_at_packet_sockets(SIM)) == []
    assert list(network.look_at_interfaces(SIM)) == []


def test_packet_sockets_are_judged_by_whether_one_can_be_had(tmp_path: Path, loopback: Loopback) -> None:
    try:
        with socket.socket(socket.AF_PACKET, socket.SOCK_RAW):
            allowed = True
    except PermissionError:
        allowed = False
    (finding,) = network.look_at_packet_sockets(_fast(load_rig(write_rig(tmp_path, loopback))))
    assert finding.level is (Level.PASS if allowed else Level.WARN)


def test_slow_cameras_need_no_packet_sockets(tmp_path: Path, loopback: Loopback) -> None:
    (finding,) = network.look_at_packet_sockets(rig_with(tmp_path, loopback, packet_socket="off"))
    assert finding.level is Level.PASS
    assert "plain sockets" in finding.what


def test_without_the_right_packet_sockets_are_a_warning(tmp_path: Path, loopback: Loopback) -> None:
    program = (
        "from pathlib import Path\nfrom rig.settings.file import load_rig\n"
        "from svev.doctor.network import look_at_packet_sockets\n"
        "from tests.svev.doctor.test_network import _fast\n"
        f"for finding in look_at_packet_sockets(_fast(load_rig(Path({str(write_rig(tmp_path, loopback))!r})))):\n"
        "    print(finding.level)"
    )
    drop = ["setpriv", "--bounding-set=-net_raw", "--inh-caps=-net_raw"] if os.geteuid() == 0 else []
    done = subprocess.run(
        [*drop, sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=False
    )
    assert done.stdout == "WARN\n", done.stderr


def test_an_address_that_is_taken_cannot_be_published_at(tmp_path: Path, loopback: Loopback) -> None:
    rig = rig_with(tmp_path, loopback)
    (free,) = network.look_at_publication(rig)
    assert free.level is Level.PASS
    with zmq.Context() as context, context.socket(zmq.PUB) as other:
        other.bind(rig.network.publish)
        (taken,) = network.look_at_publication(rig)
    assert taken.level is Level.FAIL
    assert f"{rig.network.publish}: address in use" in taken.what


def test_an_address_that_others_reach_wants_keys(tmp_path: Path, loopback: Loopback) -> None:
    everywhere = f"tcp://0.0.0.0:{loopback.free_port()}"
    (open_,) = network.look_at_publication(rig_with(tmp_path, loopback, publish=everywhere))
    assert (open_.level, "sees the images" in open_.what) == (Level.WARN, True)
    assert "svev keys" in open_.remedy
    secret, _ = make_keys(tmp_path / "hill")
    guarded = rig_with(tmp_path, loopback, publish=everywhere, curve_key_file=secret)
    (safe,) = network.look_at_publication(guarded)
    assert (safe.level, safe.what.endswith(", encrypted")) == (Level.PASS, True)
    secret.chmod(0o644)
    (readable,) = network.look_at_publication(guarded)
    assert (readable.level, "run: chmod 600" in readable.what) == (Level.FAIL, True)


def test_a_port_with_small_packets_is_found_in_a_network_of_its_own(tmp_path: Path, loopback: Loopback) -> None:
    enter = ["unshare", "--net", *([] if os.geteuid() == 0 else ["--map-root-user"]), "sh", "-c"]
    small = "ip link set lo mtu 1500 up"
    if subprocess.run([*enter, small], capture_output=True, timeout=10, check=False).returncode:
        pytest.skip("this machine allows no network namespaces, or has no `ip`")
    path = write_rig(tmp_path, loopback, simulated=False)
    doctor = f"{sys.executable} -m svev doctor --rig {path} --out {tmp_path}"
    done = subprocess.run([*enter, f"{small}; {doctor}"], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 3, done.stderr
    assert "FAIL  K1, K2, K3 by lo: MTU 1500, but packets of 9000 bytes are asked for" in done.stdout
    assert f"FAIL  K1 at {loopback.cameras(1)[0]} does not answer" in done.stdout
