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
from rig.settings.model import CameraSettings, RigSettings
from svev.doctor.finding import Finding, Topic, failure, passed, warning
from svev.gige.interfaces import Interface, interface_to

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
        yield passed(Topic.NETWORK, "frames are received through plain sockets, which suit slow cameras")
    elif _may_use_packet_sockets():
        yield passed(Topic.NETWORK, "frames are received through packet sockets")
    else:
        yield warning(
            Topic.NETWORK,
            "no right to packet sockets (CAP_NET_RAW): receiving costs several times the processor time",
            "run svev as root, or by: sudo setpriv --reuid=$USER --regid=$USER --init-groups --inh-caps=+net_raw "
            '--ambient-caps=+net_raw "$(which svev)" record ...',
        )


def look_at_socket_buffers(rig: RigSettings) -> Iterator[Finding]:
    """Are the buffers of plain sockets large enough? Too small ones lose packets, above all of the first frame."""
    plain = [
        camera for camera in gige_cameras(rig) if _prefers_plain_socket(rig, camera) or not _may_use_packet_sockets()
    ]
    if not plain:
        return
    largest = max(camera.frame_bytes for camera in plain)
    # Aravis asks for the large buffer only after the first packet, so the first frame has to fit into the default one.
    # The kernel counts its own overhead in, about as much again.
    wanted = {"rmem_max": min(SOCKET_BUFFER_BYTES, STALL_FRAMES * largest), "rmem_default": 2 * largest}
    for name, least in wanted.items():
        value = int(Path(f"/proc/sys/net/core/{name}").read_text())
        what = f"net.core.{name} is {value}"
        if value >= least:
            yield passed(Topic.NETWORK, what)
        else:
            remedy = f"run: sudo sysctl -w net.core.{name}={least} (for good: a line in /etc/sysctl.d/90-svev.conf)"
            yield warning(Topic.NETWORK, f"{what}, {least} is wanted: packets may be lost", remedy)


def look_at_interfaces(rig: RigSettings) -> Iterator[Finding]:
    """Does the network port of each camera suit it: packet size, subnet, speed for all cameras behind it?"""
    behind: dict[Interface, list[CameraSettings]] = defaultdict(list)
    for camera in gige_cameras(rig):
        try:
            interface = interface_to(str(IPv4Address(camera.address)))
        except ValueError:
            what = f"{camera.name}: {camera.address} is no IPv4 address"
            yield failure(Topic.NETWORK, what, "correct its address in the rig file")
            continue
        if interface is None:
            remedy = "give a network port an address in the camera's subnet"
            yield failure(Topic.NETWORK, f"{camera.name}: no network leads to {camera.address}", remedy)
        else:
            behind[interface].append(camera)
    for interface, cameras in behind.items():
        yield judge_interface(rig, interface, cameras)


def judge_interface(rig: RigSettings, interface: Interface, cameras: list[CameraSettings]) -> Finding:
    """Judge an interface by the needs of the cameras behind it."""
    names = ", ".join(camera.name for camera in cameras)
    link = f", {interface.speed_mbps} Mbit/s" if interface.speed_mbps else ""
    what = f"{names} by {interface.name}: MTU {interface.mtu}{link}"
    if interface.mtu < rig.network.packet_size:
        return failure(
            Topic.NETWORK,
            f"{what}, but packets of {rig.network.packet_size} bytes are asked for: no frame will arrive",
            f"run: sudo ip link set {interface.name} mtu {rig.network.packet_size}; or set network.packet_size = "
            f"{interface.mtu} in the rig file",
        )
    if not all(IPv4Address(camera.address) in interface.network for camera in cameras):
        return warning(
            Topic.NETWORK,
            f"{what}, but not every camera is in its subnet {interface.network}: frames go through a router",
            "give the network port an address in the camera's subnet",
        )
    load_mbps = sum(camera.frame_bytes for camera in cameras) * 8 * rig.trigger.rate_hz / 1e6
    if interface.speed_mbps and load_mbps > _FULL * interface.speed_mbps:
        return failure(
            Topic.NETWORK,
            f"{what}, but the frames are {load_mbps:.0f} Mbit/s",
            "give each camera a port of its own, check the cable, or lower trigger.rate_hz or the regions",
        )
    return passed(Topic.NETWORK, what)


def look_at_publication(rig: RigSettings) -> Iterator[Finding]:
    """Is the address free at which triplets are published?"""
    address = rig.network.publish
    with zmq.Context() as context, context.socket(zmq.PUB) as publisher:
        try:
            bind(publisher, address)
        except BadInputError as error:
            remedy = "end the program that uses it (another svev?), or correct network.publish"
            yield failure(Topic.NETWORK, f"triplets cannot be published: {error}", remedy)
            return
    try:
        keys = None if rig.network.curve_key_file is None else load_keys(rig.network.curve_key_file)
    except BadInputError as error:
        yield failure(Topic.NETWORK, f"triplets cannot be published: {error}", "correct network.curve_key_file")
        return
    what = f"triplets can be published at {address}"
    if exposed := exposure(address, keys):
        reason, _, remedy = exposed.partition(": ")
        yield warning(Topic.NETWORK, f"{what}; {reason}", remedy)
    else:
        yield passed(Topic.NETWORK, what + (", encrypted" if keys is not None else ""))


def _prefers_plain_socket(rig: RigSettings, camera: CameraSettings) -> bool:
    return prefers_plain_socket(rig.network, camera.frame_bytes, rig.trigger.period_ns)


def _may_use_packet_sockets() -> bool:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("CapEff:"):
            return bool(int(line.split()[1], 16) >> _CAP_NET_RAW & 1)
    return False
