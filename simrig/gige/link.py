"""The camera's network link: a UDP socket, paced to the rate of the cable."""

import errno
import socket

from rig.clocks import HostNs, host_now
from simrig.gige.gvsp import IP_UDP_BYTES, WIRE_BYTES, PacketTable
from simrig.gige.udp import NOBODY_LISTENS, bound

#: A paced link sends bursts of this length. Longer ones cost less CPU, but this is 8 packets of 9000 bytes at 1 Gbit/s,
#: and a receiver's socket holds only 12 until it has enlarged its buffer.
BURST_NS = 600_000
#: What may be caught up at once after this process was not scheduled in time: as much as a receiver's socket buffer of
#: a few MB takes. (A real camera's hardware is never late.)
_CATCH_UP_NS = 10_000_000
_UNPACED_BURST = 64  # packets
_IP_MTU_DISCOVER, _IP_PMTUDISC_DO = 10, 2  # <linux/in.h>; not in Python's socket module


class Link:
    """Sends packets from `address` to one receiver.

    Args:
        address: IPv4 address of the camera.
        mbit_s: rate of the cable; 0: as fast as the machine can.

    Raises:
        BadInputError: the address is none of this machine's.
    """

    def __init__(self, address: str, mbit_s: float) -> None:
        self._nominal_mbit_s = mbit_s
        self._slow: tuple[float, HostNs] | None = None
        self._free_at = 0
        self._peer: tuple[str, int] | None = None
        self.packet_delay_ns = 0
        self.packets = self.bytes = 0
        self._address = address
        self._socket = bound(address)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4 << 20)
        self.port: int = self._socket.getsockname()[1]

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def connect(self, address: str, port: int) -> None:
        """Choose the receiver; a connected socket spares the kernel a route look-up per packet.

        Port 0 closes the stream channel: nothing is sent any more.
        """
        if port == 0:
            self._peer = None
        elif (address, port) != self._peer:
            self._socket.connect((address, port))
            self._peer = (address, port)

    def slow_down(self, mbit_s: float, until: HostNs) -> None:
        """Carry only `mbit_s` until then."""
        self._slow = (mbit_s, until)

    def packet_ns(self, packet_size: int, now: HostNs) -> float:
        """How long a packet occupies the cable, 0 if it is not paced."""
        rate = self._nominal_mbit_s
        if self._slow is not None and now < self._slow[1]:
            rate = min(rate or self._slow[0], self._slow[0])
        wire_ns = (packet_size + WIRE_BYTES) * 8000 / rate if rate else 0.0
        return wire_ns + self.packet_delay_ns

    def begin_frame(self, ready: HostNs) -> None:
        """The next packets are those of a frame that was there at `ready`: until then the cable lay idle."""
        self._free_at = max(self._free_at, ready)

    def burst(self, packet_size: int) -> int:
        """Packets to be handed to `send_paced` at once."""
        each_ns = self.packet_ns(packet_size, host_now())
        return max(1, int(BURST_NS / each_ns)) if each_ns else _UNPACED_BURST

    def busy_ns(self) -> int:
        """How long the cable is still busy with what was sent; not positive if it is free."""
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
                # An earlier packet's refusal is reported with the next one, which has not been sent yet.
                sent = 0 if error.errno == errno.ECONNREFUSED and not retried else 1
                retried = True
            else:
                self.packets += sent
            first += sent
        self.bytes += count * packet_size

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
        """Send a packet of zeros of the given size, by a socket of its own; `whole` forbids fragments."""
        with bound(self._address) as probe:
            if whole:
                probe.setsockopt(socket.IPPROTO_IP, _IP_MTU_DISCOVER, _IP_PMTUDISC_DO)
            try:
                probe.sendto(bytes(packet_size - IP_UDP_BYTES), (address, port))
            except OSError as error:
                if error.errno not in NOBODY_LISTENS:
                    raise
