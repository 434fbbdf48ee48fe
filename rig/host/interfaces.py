"""The network interfaces of this computer, and which of them leads to an address."""

import errno
import fcntl
import os
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
_IP_MTU = 14  # linux/in.h
_STRICT = 1
_HEAD = struct.Struct("=IHHII")  # struct nlmsghdr
_ROUTE = struct.Struct("=BBBBBBBBI")  # struct rtmsg
_ATTRIBUTE = struct.Struct("=HH")  # struct rtattr: length with itself, kind
_RTM_GETROUTE, _NLM_F_REQUEST, _RTA_DST, _RTA_OIF = 26, 1, 1, 4  # linux/rtnetlink.h, linux/netlink.h
_ANSWER_S = 1.0


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


@dataclass(frozen=True, slots=True)
class Way:
    """The way of packets from this computer to an address.

    Attributes:
        interface: through which they leave.
        mtu: size of the largest packet on the whole way, as far as the kernel knows: routes have limits of their own,
            and routers tell theirs.
    """

    interface: Interface
    mtu: int


def way_to(address: str) -> Way | None:
    """The way to `address` (IPv4), as the kernel looks it up; None if there is no route."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((address, _ANY_PORT))
        except OSError:
            return None
        mtu = probe.getsockopt(socket.IPPROTO_IP, _IP_MTU)
    name = _port_to(address)
    interface = next((each for each in own_interfaces() if each.name == name), None)
    return None if interface is None else Way(interface, min(mtu, interface.mtu))


def interface_to(address: str) -> Interface | None:
    """The interface through which packets to `address` (IPv4) leave; None if there is no route."""
    way = way_to(address)
    return None if way is None else way.interface


def sharing_subnet(interface: Interface) -> list[Interface]:
    """The interface and all others whose subnets overlap with its own, by name; it alone if there are none."""
    if interface.network.is_loopback:
        return [interface]
    others = (each for each in own_interfaces() if each.network.overlaps(interface.network))
    return sorted(others, key=lambda each: each.name)


def filters_strictly(interface: Interface) -> bool:
    """Whether an interface drops packets from addresses to which this computer sends through another (RFC 3704)."""
    values = [int(Path(f"/proc/sys/net/ipv4/conf/{name}/rp_filter").read_text()) for name in ("all", interface.name)]
    return max(values) == _STRICT  # ip-sysctl.rst: the larger of the two holds


def _port_to(address: str) -> str:
    """Name of the interface through which packets to `address` leave: rtnetlink(7), RTM_GETROUTE.

    Not told by the address that a socket gets: two ports may have the same one.

    Raises:
        OSError: the kernel knows none.
    """
    request = _ROUTE.pack(socket.AF_INET, 32, 0, 0, 0, 0, 0, 0, 0) + _ATTRIBUTE.pack(8, _RTA_DST)
    request += socket.inet_aton(address)
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, 0) as kernel:
        kernel.settimeout(_ANSWER_S)
        kernel.send(_HEAD.pack(_HEAD.size + len(request), _RTM_GETROUTE, _NLM_F_REQUEST, 1, 0) + request)
        answer = kernel.recv(8192)
    place = _HEAD.size + _ROUTE.size
    while place + _ATTRIBUTE.size <= len(answer):
        length, kind = _ATTRIBUTE.unpack_from(answer, place)
        if kind == _RTA_OIF:
            return socket.if_indextoname(int.from_bytes(answer[place + 4 : place + 8], sys.byteorder))
        place += max(_ATTRIBUTE.size, (length + 3) & ~3)
    raise OSError(errno.ENETUNREACH, os.strerror(errno.ENETUNREACH))


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
