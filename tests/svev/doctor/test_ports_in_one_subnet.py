"""Camera ports in one subnet, strict filters, narrow ways: in a network of its own, with a camera behind one port.

The camera answers the discovery request alone: nothing more is asked of it.
"""

import json
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from rig.settings.file import CONFIG
from svev.doctor.finding import Level

#: Its arguments: a pipe to tell that it hears, its address.
_CAMERA = """
import ipaddress, socket, sys
who = bytearray(0xF8)
who[10:16] = bytes.fromhex("000f31010203")
who[36:40], who[52:56] = ipaddress.IPv4Address(sys.argv[2]).packed, ipaddress.IPv4Address("255.255.0.0").packed
who[104:110] = b"Marlin"
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
    channel.bind(("", 3956))
    open(sys.argv[1], "w").write("ready")
    while True:
        asked, by = channel.recvfrom(1024)
        if asked[2:4] == b"\\0\\2":
            channel.sendto(b"\\0\\0\\0\\3\\0\\xf8" + asked[6:8] + who, by)
"""
#: Its arguments: folder, Python, camera's port, its address, subnet of each port, what else is to be set, rig file.
_NETWORK = """
set -e
mount -t tmpfs tmpfs /run
ip link set lo up
ip netns add camera
for n in 1 2 3; do
    ip link add eth$n type veth peer name cam$n
    ip link set cam$n mtu 9000 up
    ip link set eth$n mtu 9000 up
    ip addr add $(echo $5 | cut -d, -f$n) dev eth$n
done
ip link set cam$3 netns camera
ip netns exec camera sh -c "ip link set lo up; ip link set cam$3 mtu 9000 up; ip addr add $4/16 dev cam$3"
for each in all eth1 eth2 eth3; do echo 0 >/proc/sys/net/ipv4/conf/$each/rp_filter; done
eval "$6"
mkfifo $1/ready
ip netns exec camera $2 $1/camera.py $1/ready $4 &
read -r _ <$1/ready || true
$2 -m svev doctor --rig $7 --out $1 --json || true
kill $!
"""
_FACTORY = ("169.254.1.1/16", "169.254.2.1/16", "169.254.3.1/16")
_OWN = ("192.168.11.1/24", "192.168.12.1/24", "192.168.13.1/24")


@pytest.fixture(scope="module", autouse=True)
def _networks() -> None:
    command = [
        "unshare",
        "--net",
        "--mount",
        "sh",
        "-c",
        "mount -t tmpfs tmpfs /run && ip netns add a && ip netns exec a true",
    ]
    try:
        done = subprocess.run(command, capture_output=True, timeout=10, check=False)
    except FileNotFoundError:
        pytest.skip("this machine has no `unshare`")
    if done.returncode:
        pytest.skip("this machine allows no network namespaces, or has no `ip`")


def _doctor(
    folder: Path, subnets: Sequence[str], cameras: Sequence[str], behind: int, place: int, more: str = ":"
) -> dict[str, dict[str, str]]:
    """Findings about network and cameras, by code.

    Args:
        folder: of the test.
        subnets: address of each port.
        cameras: addresses of K1, K2, K3 in the rig file.
        behind: number of the port behind which the only camera is.
        place: which of the cameras it is.
        more: what the shell is to set before.
    """
    text = (CONFIG / "rigs" / "hill-gige.toml").read_text()
    old = iter(cameras)
    text = re.sub(r'^address = "192.*"$', lambda _: f'address = "{next(old)}"', text, flags=re.MULTILINE)
    (folder / "rig.toml").write_text(text)
    (folder / "camera.py").write_text(_CAMERA)
    arguments = [folder, sys.executable, behind, cameras[place], ",".join(subnets), more, folder / "rig.toml"]
    command = ["unshare", "--net", "--mount", "sh", "-c", _NETWORK, "sh", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=90, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["findings"]
    return {each["code"]: each for each in found if each["topic"] in {"network", "cameras"}}


def test_ports_that_share_a_subnet_are_named_and_the_one_that_is_used(tmp_path: Path) -> None:
    found = _doctor(tmp_path, _FACTORY, ["169.254.10.1", "169.254.10.2", "169.254.10.3"], behind=2, place=1)
    shared = found["check_shared_elsewhere"]
    assert shared["level"] == Level.FAIL
    assert shared["what"] == (
        "the ports eth1, eth2, eth3 share the subnet 169.254.0.0/16, and the computer sends to K1, K2, K3 by "
        "eth1 alone; K1, K2, K3 cannot be found there"
    )
    assert "give each port a subnet of its own" in shared["remedy"]
    assert not {"check_link", "check_link_speed"} & set(found)  # no PASS beside it
    silent = found["check_no_answer_shared"]
    assert "does not answer by eth1, the one port by which the computer asks it" in silent["what"]
    assert "power" not in silent["remedy"]
    there = found["check_found_elsewhere"]
    assert "found behind eth2" in there["what"]
    assert "at 169.254.10.2, but the computer sends to this address by eth1" in there["what"]
    assert not {"check_rp_filter", "check_no_answer"} & set(found)


def test_cameras_behind_the_port_that_is_used_are_a_warning(tmp_path: Path) -> None:
    found = _doctor(tmp_path, _FACTORY, ["169.254.10.1", "192.168.200.1", "192.168.201.1"], behind=1, place=0)
    assert found["check_shared_there"]["level"] == Level.WARN
    assert "the computer sends to K1 by eth1 alone; all of them are there" in found["check_shared_there"]["what"]
    assert "169.254.10.1" in found["check_answers"]["what"]
    assert found["check_answers"]["level"] == Level.PASS


def test_a_strict_filter_of_a_shared_subnet_is_named(tmp_path: Path) -> None:
    strict = "echo 1 >/proc/sys/net/ipv4/conf/all/rp_filter; echo 2 >/proc/sys/net/ipv4/conf/eth3/rp_filter"
    found = _doctor(
        tmp_path, _FACTORY, ["169.254.10.1", "169.254.10.2", "169.254.10.3"], behind=2, place=1, more=strict
    )
    (said, remedy) = (found["check_rp_filter"][key] for key in ("what", "remedy"))
    assert said.startswith("eth2: what comes in here from addresses to which the computer sends by eth1 is dropped")
    assert "sudo sysctl -w net.ipv4.conf.eth2.rp_filter=2" in remedy
    assert "eth3" not in remedy


def test_ports_with_subnets_of_their_own_are_good_and_a_narrow_way_is_not(tmp_path: Path) -> None:
    cameras = ["192.168.11.2", "192.168.12.2", "192.168.13.2"]
    narrow = "ip route add 192.168.12.2 dev eth2 mtu 1500; echo 1 >/proc/sys/net/ipv4/conf/all/rp_filter"
    found = _doctor(tmp_path, _OWN, cameras, behind=1, place=0, more=narrow)
    assert found["check_link"]["level"] == Level.PASS
    assert "192.168.11.2" in found["check_answers"]["what"]
    way = found["check_way_narrow"]
    assert way["what"].startswith(
        "K2: the way to 192.168.12.2 by eth2 takes packets of 1500 bytes, and 9000 are asked for"
    )
    assert not {code for code in found if "shared" in code or code == "check_rp_filter"}
    assert "check its power and cable" in found["check_no_answer"]["remedy"]
