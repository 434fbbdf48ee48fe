"""The network interfaces of this computer, and which of them leads to an address."""

import fcntl
import socket
import struct
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv4Network
from pathlib import Path

_SIOCGIFADDR, _SIOCGIFNETMASK, _SIOCGIFMTU = 0x8915, 0x891B, 0x8921  # linux/sockios.h
_REQUEST = struct.Struct("16s24s")  # struct ifreq: name, then a sockaddr or a number
_ANY_PORT = 9  # "connecting" a datagram socket sends nothing


@dataclass(frozen=True, slots=True)
class Interface:
    """One network interface.

    Attributes:
        mtu: size of the largest packet, IP header included, bytes.
        speed_mbps: speed of the link; None: it has none (loopback, virtual).
        network: addresses that can be reached without a router.
        address: the interface's own.
    """

    name: str
    mtu: int
    speed_mbps: int | None
    network: IPv4Network
    address: IPv4Address


def own_interfaces() -> Iterator[Interface]:
    """All interfaces that have an IPv4 address."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        for _, name in socket.if_nameindex():
            with suppress(OSError):  # interfaces without an address
                here = IPv4Address(_ask(probe, _SIOCGIFADDR, name)[4:8])
                mask = IPv4Address(_ask(probe, _SIOCGIFNETMASK, name)[4:8])
                mtu = int.from_bytes(_ask(probe, _SIOCGIFMTU, name)[:4], sys.byteorder)
                yield Interface(name, mtu, _speed(name), IPv4Network(f"{here}/{mask}", strict=False), here)


def interface_to(address: str) -> Interface | None:
    """The interface through which packets to `address` (IPv4) leave; None if there is no route."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((address, _ANY_PORT))
        except OSError:
            return None
        own = IPv4Address(probe.getsockname()[0])
    for interface in own_interfaces():
        if interface.address == own or (interface.network.is_loopback and own in interface.network):
            return interface
    return None


def _ask(probe: socket.socket, request: int, name: str) -> bytes:
    """The answer of netdevice(7), without the interface name at its beginning."""
    return fcntl.ioctl(probe, request, _REQUEST.pack(name.encode(), b""))[16:]


def _speed(name: str) -> int | None:
    """Speed of the link, Mbit/s; None if the interface has none: no such file, not readable, or -1 in it."""
    try:
        speed = int(Path(f"/sys/class/net/{name}/speed").read_text())
    except OSError:
        return None
    return speed if speed > 0 else None
