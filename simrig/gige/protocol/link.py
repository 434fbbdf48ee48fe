"""The camera's UDP sockets, and its network link: a socket for the stream, paced to the rate of the cable."""

import errno
import socket

from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import BadInputError
from simrig.gige.protocol.gvsp import IP_UDP_BYTES, WIRE_BYTES, PacketTable
from simrig.world.statistics import Counters

#: Errors of sending that mean that nobody listens. A real camera would not even notice; the simulated one ignores them.
NOBODY_LISTENS = frozenset(
    {errno.ECONNREFUSED, errno.ENETUNREACH, errno.EHOSTUNREACH, errno.EMSGSIZE, errno.EPERM, errno.EINVAL}
)
#: A paced link sends bursts of this length: 8 packets of 9000 bytes at 1 Gbit/s. Longer bursts cost less CPU, but a
#: receiver's socket holds only 12 such packets until the receiver has enlarged its buffer.
BURST_NS = 600_000
#: After this process was scheduled late, the link catches up with so much at once: what a receiver's socket buffer of a
#: few MB takes. (A real camera's hardware is never late.)
_CATCH_UP_NS = 10_000_000
_UNPACED_BURST = 64  # packets
_IP_MTU_DISCOVER, _IP_PMTUDISC_DO = 10, 2  # <linux/in.h>; not in Python's socket module


class Link:
    """Sends packets from `address` to one receiver.

    Args:
        address: IPv4 address of the camera.
        mbit_s: rate of the cable; 0: as fast as the machine can.
        counters: the link counts packets and bytes here.

    Attributes:
        packet_delay_ns: pause after each packet.
        limit_bytes_s: bytes of packets per second at most; 0: no limit.

    Raises:
        BadInputError: the address is none of this machine's.
    """

    def __init__(self, address: str, mbit_s: float, counters: Counters) -> None:
        self._nominal_mbit_s = mbit_s
        self._slow: tuple[float, HostNs] | None = None
        self._free_at = 0
        self._peer: tuple[str, int] | None = None
        self.packet_delay_ns = 0
        self.limit_bytes_s = 0
        self._counters = counters
        self._address = address
        self._socket = bound(address)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 << 20)
        self.port: int = self._socket.getsockname()[1]

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def move(self, address: str) -> None:
        """Send from another address of the camera; nothing may be streaming.

        Raises:
            BadInputError: the address is none of this machine's.
        """
        old, self._socket = self._socket, bound(address)
        old.close()
        self._address, self._peer = address, None
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 << 20)
        self.port = self._socket.getsockname()[1]

    def connect(self, address: str, port: int) -> None:
        """Choose the receiver; with port 0 (stream channel closed) the link sends nothing any more."""
        if port == 0:
            self._peer = None
        elif (address, port) != self._peer:
            self._socket.connect((address, port))  # saves the kernel a route look-up per packet
            self._peer = (address, port)

    def slow_down(self, mbit_s: float, until: HostNs) -> None:
        """Carry only `mbit_s` until host time `until`."""
        self._slow = (mbit_s, until)

    def packet_ns(self, packet_size: int, now: HostNs) -> float:
        """How long a packet occupies the cable, ns; 0 if the link is not paced."""
        rate = self._nominal_mbit_s
        if self._slow is not None and now < self._slow[1]:
            rate = min(rate or self._slow[0], self._slow[0])
        wire_ns = (packet_size + WIRE_BYTES) * 8000 / rate if rate else 0.0
        limited_ns = packet_size * NS_PER_S / self.limit_bytes_s if self.limit_bytes_s else 0.0
        return max(wire_ns + self.packet_delay_ns, limited_ns)

    def begin_frame(self, ready: HostNs) -> None:
        """The next packets belong to a frame that was ready at `ready`; the cable was idle until then."""
        self._free_at = max(self._free_at, ready)

    def burst(self, packet_size: int) -> int:
        """Number of packets to hand to `send_paced` at once."""
        each_ns = self.packet_ns(packet_size, host_now())
        return max(1, int(BURST_NS / each_ns)) if each_ns else _UNPACED_BURST

    def busy_ns(self) -> int:
        """How long the cable is still busy with sent packets, ns; not positive if it is free."""
        return self._free_at - host_now()

    def send_paced(self, table: PacketTable, first: int, count: int, packet_size: int) -> None:
        """Send packets, and keep the cable busy for as long as they take."""
        now = host_now()
        self._free_at = max(self._free_at, now - _CATCH_UP_NS) + round(count * self.packet_ns(packet_size, now))
        self.send(table, first, count, packet_size)

    def send(self, table: PacketTable, first: int, count: int, packet_size: int) -> None:
        """Send packets at once."""
        if self._peer is None:
            return
        end, retried = first + count, False
        while first < end:
            try:
                sent = table.send(self._socket.fileno(), first, end - first)
            except OSError as error:
                if error.errno not in NOBODY_LISTENS:
                    raise
                # The kernel reports the refusal of an earlier packet with the next one, which it has not sent yet.
                sent = 0 if error.errno == errno.ECONNREFUSED and not retried else 1
                retried = True
            else:
                self._counters.packets += sent
            first += sent
        self._counters.bytes += count * packet_size

    def send_datagram(self, data: bytes) -> None:
        """Send one datagram at once."""
        if self._peer is None:
            return
        try:
            self._socket.send(data)
        except OSError as error:
            if error.errno not in NOBODY_LISTENS:
                raise

    def send_test_packet(self, address: str, port: int, packet_size: int, *, whole: bool) -> None:
        """Send a packet of zeros of the given size from a socket of its own; `whole` forbids fragments."""
        with bound(self._address) as probe:
            if whole:
                probe.setsockopt(socket.IPPROTO_IP, _IP_MTU_DISCOVER, _IP_PMTUDISC_DO)
            try:
                probe.sendto(bytes(packet_size - IP_UDP_BYTES), (address, port))
            except OSError as error:
                if error.errno not in NOBODY_LISTENS:
                    raise


def bound(address: str, port: int = 0, *, shared: bool = False) -> socket.socket:
    """A UDP socket of the camera, bound to `address`.

    Args:
        address: IPv4 address.
        port: UDP port; 0: any free one.
        shared: whether several sockets may be bound to it (broadcast addresses).

    Raises:
        BadInputError: the address is in use or none of this machine's.
    """
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        if shared:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((address, port))
    except OSError as error:
        made.close()
        raise BadInputError(_in_words(f"{address}:{port}", error)) from None
    return made


def _in_words(place: str, error: OSError) -> str:
    match error.errno:
        case errno.EADDRINUSE:
            return f"address {place} is in use by another program: stop it or choose another address"
        case errno.EADDRNOTAVAIL:
            return f"address {place} is none of this machine's: choose another, e.g. 127.0.0.11"
        case _:
            return f"address {place} cannot be bound ({error.strerror}): choose another address"
