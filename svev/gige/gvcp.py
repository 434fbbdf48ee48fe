"""Asks GigE Vision cameras who they are, by address or by broadcast, and gives them IP addresses.

A camera whose address does not fit into the subnet of its network port cannot be reached by it, and Aravis does not see
it. It hears broadcasts all the same, and if it is allowed to, answers with a broadcast (GigE Vision 2.0, section 14.1).
"""

import socket
import struct
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import IPv4Address
from typing import Final

from rig.host.interfaces import Interface, interface_to, own_interfaces

PORT: Final = 3956
_REQUEST = struct.Struct(">BBHHH")  # 0x42, flags, command, length, request id (GigE Vision 2.0, section 15)
_ANSWER = struct.Struct(">HHHH")  # status, acknowledge, length, request id
_FORCE_IP = struct.Struct(">2xHI12xI12xI12xI")  # MAC address in two parts, address, mask, gateway (section 14.2)
_KEY, _WANTS_ANSWER, _BY_BROADCAST = 0x42, 0x01, 0x10
_DISCOVERY, _FORCEIP, _READ_REGISTER, _WRITE_REGISTER = 0x0002, 0x0004, 0x0080, 0x0082
_CONTROL_CHANNEL_PRIVILEGE = 0x0A00
_CONTROLLED = 0b11  # exclusive access or control access is taken
_REQUESTS_MOST = 3
_EVERYBODY: Final = "255.255.255.255"
_DISCOVERY_BYTES = 0xF8
_SEARCH_S = 1.0  # section 14.1: a camera waits up to a second before it answers, so that not all answer at once


@dataclass(frozen=True, slots=True)
class GigeCamera:
    """Answer of a camera to the discovery request.

    Attributes:
        name: the name that its owner gave it.
        mac: MAC address, e.g. "00:0f:31:01:02:03".
        address: its present IPv4 address.
        mask: its present subnet mask.
    """

    vendor: str
    model: str
    serial: str
    name: str
    mac: str
    address: str
    mask: str


@dataclass(frozen=True, slots=True)
class FoundCamera:
    """A camera that answered a broadcast.

    Attributes:
        camera: what it says of itself.
        interface: the network port behind which it is.
        reachable: whether its address is in the subnet of this port.
        asked: it answers at its address alone, not to a broadcast.
    """

    camera: GigeCamera
    interface: Interface
    reachable: bool
    asked: bool = False


def ask_camera(address: str, timeout_s: float) -> tuple[GigeCamera, bool] | None:
    """Ask the camera at `address` what it is, and whether a program controls it.

    Returns:
        None if nothing answers within `timeout_s` seconds.

    Raises:
        OSError: there is no route to the address.
        ValueError: the answer is not that of a camera.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
        channel.connect((address, PORT))
        who = _ask(channel, _DISCOVERY, b"", timeout_s)
        if who is None:
            return None
        camera = _camera(who)
        control = _ask(channel, _READ_REGISTER, struct.pack(">I", _CONTROL_CHANNEL_PRIVILEGE), timeout_s)
    return camera, control is not None and len(control) == 4 and bool(control[3] & _CONTROLLED)


def find_cameras(only: str | None = None) -> list[FoundCamera]:
    """All cameras behind the network ports of this computer, also those whose address fits no subnet; takes a second.

    Args:
        only: look behind this port alone, e.g. "enp2s0".
    """
    found: dict[str, FoundCamera] = {}
    for interface, payload in _broadcast(_DISCOVERY, b"", _BY_BROADCAST, only):
        with suppress(ValueError):  # somebody else's answer
            camera = _camera(payload)
            reachable = IPv4Address(camera.address) in interface.network
            if reachable or camera.mac not in found:  # several ports may lead to the same switch
                found[camera.mac] = FoundCamera(camera, interface, reachable)
    return sorted(found.values(), key=lambda each: IPv4Address(each.camera.address))


def ask_cameras(addresses: Iterable[str], timeout_s: float) -> list[FoundCamera]:
    """Cameras that answer at these addresses, in networks that carry no broadcast, where `find_cameras` is blind.

    Args:
        addresses: one by one.
        timeout_s: so long each is waited for, s.
    """
    found = []
    for address in addresses:
        with suppress(OSError, ValueError):  # no way leads there, or there is no camera
            answer, port = ask_camera(address, timeout_s), interface_to(address)
            if answer is not None and port is not None:
                found.append(FoundCamera(answer[0], port, reachable=True, asked=True))
    return found


def force_address(mac: str, interface: Interface, address: IPv4Address) -> None:
    """Give the camera with this MAC address another one in the subnet of its port, until its power goes.

    Cameras need not answer, and one that changes its address may answer too early or too late to be heard: whether it
    has obeyed, `find_cameras` says.
    """
    number = int(mac.replace(":", ""), 16)
    high, low = number >> 32, number & 0xFFFFFFFF
    order = _FORCE_IP.pack(high, low, int(address), int(interface.network.netmask), 0)
    for _ in _broadcast(_FORCEIP, order, 0, interface.name):
        pass


def _broadcast(command: int, payload: bytes, flags: int, only: str | None = None) -> Iterator[tuple[Interface, bytes]]:
    """Send a command to everybody behind every port, or the one named; give the payloads of the answers."""
    request = _REQUEST.pack(_KEY, _WANTS_ANSWER | flags, command, len(payload), 1) + payload
    sockets: list[tuple[Interface, socket.socket]] = []
    try:
        for interface in own_interfaces():
            if only in {None, interface.name}:
                sockets.append((interface, socket.socket(socket.AF_INET, socket.SOCK_DGRAM)))
                _send_to_everybody(sockets[-1][1], interface, request)
        deadline = time.monotonic() + _SEARCH_S
        for interface, channel in sockets:
            for answer in _answers(channel, deadline):
                if len(answer) >= _ANSWER.size and _ANSWER.unpack_from(answer)[:2] == (0, command + 1):
                    yield interface, answer[_ANSWER.size :]
    finally:
        for _, channel in sockets:
            channel.close()


def _send_to_everybody(channel: socket.socket, interface: Interface, request: bytes) -> None:
    """Send through one port; answers by broadcast are received only by a socket without an address of its own."""
    channel.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface.name.encode())
    channel.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
    channel.bind(("", 0))
    # Linux delivers the broadcast to all networks on no loopback interface, but that of its subnet.
    everybody = str(interface.network.broadcast_address) if interface.network.is_loopback else _EVERYBODY
    with suppress(OSError):  # a port without a cable: nobody is there
        channel.sendto(request, (everybody, PORT))


def _answers(channel: socket.socket, deadline: float) -> Iterator[bytes]:
    """Datagrams until the deadline; those that have come already also after it."""
    while True:
        channel.settimeout(max(0.0, deadline - time.monotonic()))
        try:
            yield channel.recv(1024)
        except (TimeoutError, BlockingIOError):
            return


def write_register(channel: socket.socket, register: int, value: int, timeout_s: float) -> bool:
    """Write a register of the camera to which a socket is connected; False: it refuses, or does not answer."""
    answer = _answer(channel, _WRITE_REGISTER, struct.pack(">II", register, value), timeout_s)
    return answer is not None and _ANSWER.unpack_from(answer)[0] == 0


def _ask(channel: socket.socket, command: int, payload: bytes, timeout_s: float) -> bytes | None:
    """The payload of the answer, None if there is none."""
    answer = _answer(channel, command, payload, timeout_s)
    return None if answer is None else answer[_ANSWER.size :]


def _answer(channel: socket.socket, command: int, payload: bytes, timeout_s: float) -> bytes | None:
    """The answer, None if there is none; repeats the request, since a datagram may get lost."""
    for request_id in range(1, _REQUESTS_MOST + 1):
        channel.send(_REQUEST.pack(_KEY, _WANTS_ANSWER, command, len(payload), request_id) + payload)
        deadline = time.monotonic() + timeout_s / _REQUESTS_MOST
        while (left := deadline - time.monotonic()) > 0:
            channel.settimeout(left)
            try:
                answer = channel.recv(1024)
            except (TimeoutError, ConnectionRefusedError):  # refused: the address is of a computer, not of a camera
                break
            if len(answer) >= _ANSWER.size and _ANSWER.unpack_from(answer)[1] == command + 1:
                return answer
    return None


def _camera(who: bytes) -> GigeCamera:
    if len(who) < _DISCOVERY_BYTES:
        raise ValueError(f"the discovery answer has {len(who)} bytes, {_DISCOVERY_BYTES} are due")
    mac = ":".join(f"{byte:02x}" for byte in who[10:16])
    address, mask = IPv4Address(who[36:40]), IPv4Address(who[52:56])
    return GigeCamera(
        _text(who[72:104]), _text(who[104:136]), _text(who[216:232]), _text(who[232:248]), mac, str(address), str(mask)
    )


def _text(field: bytes) -> str:
    return field.split(b"\0")[0].decode(errors="replace")
