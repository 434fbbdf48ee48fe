"""Network interfaces: which one leads to an address, and what it can carry."""

import fcntl
import socket
import struct
import sys
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv4Network
from pathlib import Path

_SIOCGIFADDR, _SIOCGIFNETMASK, _SIOCGIFMTU = 0x8915, 0x891B, 0x8921  # linux/sockios.h
_REQUEST = struct.Struct("16s24s")  # struct ifreq: name, then a sockaddr or a number
_ANY_PORT = 9  # nothing is ever sent to it


@dataclass(frozen=True, slots=True)
class Interface:
    """One network interface.

    Attributes:
        mtu: bytes of the largest packet, IP header included.
        speed_mbps: of the link, None where it has none (loopback, virtual).
        network: the addresses that are reached without a router.
    """

    name: str
    mtu: int
    speed_mbps: int | None
    network: IPv4Network


def interface_to(address: str) -> Interface | None:
    """The interface whose packets leave to `address` (IPv4); None if there is no way."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((address, _ANY_PORT))
        except OSError:
            return None
        own = IPv4Address(probe.getsockname()[0])
        for _, name in socket.if_nameindex():
            with suppress(OSError):  # an interface without an address
                here = IPv4Address(_ask(probe, _SIOCGIFADDR, name)[4:8])
                mask = IPv4Address(_ask(probe, _SIOCGIFNETMASK, name)[4:8])
                network = IPv4Network(f"{here}/{mask}", strict=False)
                if here == own or (network.is_loopback and own in network):
                    mtu = int.from_bytes(_ask(probe, _SIOCGIFMTU, name)[:4], sys.byteorder)
                    return Interface(name, mtu, _speed(name), network)
    return None


def _ask(probe: socket.socket, request: int, name: str) -> bytes:
    """The answer of netdevice(7), without the name that it begins with."""
    return fcntl.ioctl(probe, request, _REQUEST.pack(name.encode(), b""))[16:]


def _speed(name: str) -> int | None:
    """Mbit/s of the link; an interface without one has no such file, refuses to read it, or says -1."""
    try:
        speed = int(Path(f"/sys/class/net/{name}/speed").read_text())
    except OSError:
        return None
    return speed if speed > 0 else None
