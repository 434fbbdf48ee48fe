"""Examines the network: can the packets of GigE Vision cameras be received, and triplets be published?"""

from collections import defaultdict
from collections.abc import Iterator
from ipaddress import IPv4Address
from pathlib import Path

import zmq

from capture.aravis.receive_socket import SOCKET_BUFFER_BYTES, STALL_FRAMES, prefers_plain_socket
from recorder.publishing.keys import exposure, load_keys
from recorder.publishing.publisher import bind
from rig.errors import BadInputError
from rig.host.interfaces import Interface, Way, filters_strictly, sharing_subnet, way_to
from rig.phrase import phrase
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings
from svev.doctor.finding import Finding, Level, Topic, failure, judged, passed, warning
from svev.gige.gvcp import find_cameras

_CAP_NET_RAW = 13  # linux/capability.h
_FULL = 0.9  # share of a link's speed above which packets cannot be sent again


def gige_cameras(rig: RigSettings) -> list[CameraSettings]:
    """The cameras of a rig that send their frames over the network."""
    return [camera for camera in rig.cameras if camera.backend == "aravis"]


def look_at_packet_sockets(rig: RigSettings) -> Iterator[Finding]:
    """May we use packet sockets? They save most of the processor time for fast cameras, but need a privilege."""
    cameras = gige_cameras(rig)
    plain = [camera for camera in cameras if _prefers_plain_socket(rig, camera)]
    if not cameras:
        return
    if len(plain) == len(cameras):
        what = "frames are received through plain sockets, which suit slow cameras"
        yield passed(Topic.NETWORK, "check_plain_sockets", what)
    elif _may_use_packet_sockets():
        yield passed(Topic.NETWORK, "check_packet_sockets", "frames are received through packet sockets")
    else:
        yield warning(
            Topic.NETWORK,
            "check_no_packet_sockets",
            "no right to packet sockets (CAP_NET_RAW): receiving costs several times the processor time",
            "run svev as root, or by: sudo setpriv --reuid=$USER --regid=$USER --init-groups --inh-caps=+net_raw "
            '--ambient-caps=+net_raw "$(which svev)" record ...',
        )


def look_at_socket_buffers(rig: RigSettings) -> Iterator[Finding]:
    """May the buffers of plain sockets be large enough? Too small ones lose packets."""
    plain = [
        camera for camera in gige_cameras(rig) if _prefers_plain_socket(rig, camera) or not _may_use_packet_sockets()
    ]
    if not plain:
        return
    least = min(SOCKET_BUFFER_BYTES, STALL_FRAMES * max(camera.frame_bytes for camera in plain))
    name = "rmem_max"
    value = int(Path(f"/proc/sys/net/core/{name}").read_text())
    if value >= least:
        what = "net.core.{name} is {value}"
        yield passed(Topic.NETWORK, "check_socket_buffer", what, name=name, value=str(value))
    else:
        yield warning(
            Topic.NETWORK,
            "check_socket_buffer_small",
            "net.core.{name} is {value}, {least} is wanted: packets may be lost",
            "run: sudo sysctl -w net.core.{name}={least} (for good: a line in /etc/sysctl.d/90-svev.conf)",
            name=name,
            value=str(value),
            least=str(least),
        )


def look_at_interfaces(rig: RigSettings) -> Iterator[Finding]:
    """Does the network port of each camera suit it: packet size, subnet of its own, speed for all cameras behind it?"""
    behind: dict[Interface, list[CameraSettings]] = defaultdict(list)
    for camera in gige_cameras(rig):
        try:
            way = way_to(str(IPv4Address(camera.address)))
        except ValueError:
            what, remedy = "{camera}: {address} is no IPv4 address", "correct its address in the rig file"
            yield failure(Topic.NETWORK, "check_no_ipv4", what, remedy, camera=camera.name, address=camera.address)
            continue
        if way is None:
            remedy = "give a network port an address in the camera's subnet"
            what = "{camera}: no network leads to {address}"
            yield failure(Topic.NETWORK, "check_no_way", what, remedy, camera=camera.name, address=camera.address)
            continue
        behind[way.interface].append(camera)
        if way.mtu < rig.network.packet_size <= way.interface.mtu:
            yield _judge_way(rig, camera, way)
    for interface, cameras in behind.items():
        if len(sharing := sharing_subnet(interface)) > 1:
            yield from _judge_shared(interface, sharing, cameras)
        else:
            yield judge_interface(rig, interface, cameras)


def _judge_way(rig: RigSettings, camera: CameraSettings, way: Way) -> Finding:
    """The port takes packets as large as are asked for, and the way behind it does not."""
    return failure(
        Topic.NETWORK,
        "check_way_narrow",
        "{camera}: the way to {address} by {port} takes packets of {mtu} bytes, and {size} are asked for: frames may "
        "not arrive",
        "connect the camera to {port} without a router, look at: ip route get {address}; or set network.packet_size = "
        "{mtu} in the rig file",
        camera=camera.name,
        address=camera.address,
        port=way.interface.name,
        mtu=str(way.mtu),
        size=str(rig.network.packet_size),
    )


def _judge_shared(interface: Interface, sharing: list[Interface], cameras: list[CameraSettings]) -> Iterator[Finding]:
    """Judge ports whose subnets overlap: the computer sends to all addresses in them through one of these ports.

    Args:
        interface: that port.
        sharing: all of them.
        cameras: those that have such an address.
    """
    found = {each.camera.address: each.interface.name for each in find_cameras()}
    elsewhere = [camera for camera in cameras if found.get(camera.address) != interface.name]
    said = phrase(
        "check_shared",
        "the ports {ports} share the subnet {subnet}, and the computer sends to {cameras} by {port} alone",
        ports=", ".join(each.name for each in sharing),
        subnet=str(interface.network),
        cameras=", ".join(camera.name for camera in cameras),
        port=interface.name,
    )
    remedy = (
        "give each port a subnet of its own (192.168.11.1/24, 192.168.12.1/24, ...), and each camera an address in "
        "that of its port: svev cameras set-ip"
    )
    if elsewhere:
        what = "{said}; {elsewhere} cannot be found there"
        names = ", ".join(camera.name for camera in elsewhere)
        yield failure(Topic.NETWORK, "check_shared_elsewhere", what, remedy, said=said, elsewhere=names)
    else:
        yield warning(Topic.NETWORK, "check_shared_there", "{said}; all of them are there", remedy, said=said)
    strict = [each.name for each in sharing if each != interface and filters_strictly(each)]
    if strict:
        yield failure(
            Topic.NETWORK,
            "check_rp_filter",
            "{ports}: what comes in here from addresses to which the computer sends by {port} is dropped "
            "(rp_filter = 1)",
            "give each port a subnet of its own, or run: {commands}",
            ports=", ".join(strict),
            port=interface.name,
            commands="; ".join(f"sudo sysctl -w net.ipv4.conf.{name}.rp_filter=2" for name in strict),
        )


def judge_interface(rig: RigSettings, interface: Interface, cameras: list[CameraSettings]) -> Finding:
    """Judge an interface by the needs of the cameras behind it."""
    names = ", ".join(camera.name for camera in cameras)
    port, mtu, speed = interface.name, interface.mtu, interface.speed_mbps
    if speed:
        text = "{cameras} by {port}: MTU {mtu}, {speed} Mbit/s"
        said = phrase("check_link_speed", text, cameras=names, port=port, mtu=str(mtu), speed=speed)
    else:
        said = phrase("check_link", "{cameras} by {port}: MTU {mtu}", cameras=names, port=port, mtu=str(mtu))
    if interface.mtu < rig.network.packet_size:
        return failure(
            Topic.NETWORK,
            "check_mtu_small",
            "{said}, but packets of {size} bytes are asked for: no frame will arrive",
            "run: sudo ip link set {port} mtu {size}; or set network.packet_size = {mtu} in the rig file",
            said=said,
            size=str(rig.network.packet_size),
            port=port,
            mtu=str(mtu),
        )
    if not all(IPv4Address(camera.address) in interface.network for camera in cameras):
        return warning(
            Topic.NETWORK,
            "check_router",
            "{said}, but not every camera is in its subnet {subnet}: frames go through a router",
            "give the network port an address in the camera's subnet",
            said=said,
            subnet=str(interface.network),
        )
    load_mbps = sum(camera.frame_bytes for camera in cameras) * 8 * rig.trigger.rate_hz / 1e6
    if interface.speed_mbps and load_mbps > _FULL * interface.speed_mbps:
        return failure(
            Topic.NETWORK,
            "check_link_full",
            "{said}, but the frames are {load:.0f} Mbit/s",
            "give each camera a port of its own, check the cable, or lower trigger.rate_hz or the regions",
            said=said,
            load=load_mbps,
        )
    return judged(Level.PASS, Topic.NETWORK, said, "")


def look_at_publication(rig: RigSettings) -> Iterator[Finding]:
    """Is the address free at which triplets are published?"""
    address = rig.network.publish
    with zmq.Context() as context, context.socket(zmq.PUB) as publisher:
        try:
            bind(publisher, address)
        except BadInputError as error:
            remedy = "end the program that uses it (another svev?), or correct network.publish"
            what = "triplets cannot be published: {why}"
            yield failure(Topic.NETWORK, "check_not_published", what, remedy, why=error.said)
            return
    try:
        keys = None if rig.network.curve_key_file is None else load_keys(rig.network.curve_key_file)
    except BadInputError as error:
        what, remedy = "triplets cannot be published: {why}", "correct network.curve_key_file"
        yield failure(Topic.NETWORK, "check_keys_wrong", what, remedy, why=error.said)
        return
    what = "triplets can be published at {address}"
    if exposure(address, keys) is not None:
        what = "triplets can be published at {address}; whoever reaches {address} sees the images"
        remedy = "publish on tcp://127.0.0.1, or with a key (svev keys)"
        yield warning(Topic.NETWORK, "check_published_openly", what, remedy, address=address)
    elif keys is not None:
        what = "triplets can be published at {address}, encrypted"
        yield passed(Topic.NETWORK, "check_published_encrypted", what, address=address)
    else:
        yield passed(Topic.NETWORK, "check_published", what, address=address)


def _prefers_plain_socket(rig: RigSettings, camera: CameraSettings) -> bool:
    return prefers_plain_socket(rig.network, camera.frame_bytes, rig.trigger.period_ns)


def _may_use_packet_sockets() -> bool:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("CapEff:"):
            return bool(int(line.split()[1], 16) >> _CAP_NET_RAW & 1)
    return False
