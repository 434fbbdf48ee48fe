"""Watches the connections to a publishing socket, and closes those that ask too much.

A subscriber has nothing to send but a few short topics. ZeroMQ would take any number of connections and subscriptions,
and while they pour in, the thread that publishes would do nothing else. So a thread of its own looks at every
connection: how many there are, and how many bytes each has sent, which the kernel counts (TCP_INFO). Connections to
`ipc://` addresses are counted only: who may open the socket's file is trusted.
"""

import errno
import os
import socket
import struct
import threading
import time
from collections import Counter
from contextlib import suppress
from typing import Final

import zmq

#: Connections at a time.
MOST_PEERS: Final = 64
#: What a connection may send: so much at once, and so much more in each second.
_ALLOWED_BYTES: Final = 64 * 1024
_ALLOWED_BYTES_PER_S: Final = 1024
_LOOK_S: Final = 0.02
#: After a connection has sent too much, no other one from its address is taken for this time.
_CLOSED_S: Final = 10.0
_JOIN_S: Final = 5.0

_BYTES_RECEIVED: Final = struct.Struct("=128xQ")  # tcpi_bytes_received of struct tcp_info, linux/tcp.h
_EVENT: Final = struct.Struct("=Hi")  # zmq_socket_monitor(3): event, value
_ESTABLISHED: Final = 1  # TCP_ESTABLISHED, in the first byte of struct tcp_info
_EVENTS: Final = zmq.EVENT_ACCEPTED | zmq.EVENT_DISCONNECTED | zmq.EVENT_MONITOR_STOPPED


class _Peer:
    """One connection: a descriptor of our own for the socket that ZeroMQ uses.

    Args:
        descriptor: ZeroMQ's.
        endpoint: where it was accepted, e.g. `tcp://127.0.0.1:5556`.

    Attributes:
        host: address of the other side; empty for connections through a file.

    Raises:
        OSError: the connection has ended already, or there is no further descriptor.
    """

    def __init__(self, descriptor: int, endpoint: str) -> None:
        self._socket = socket.socket(fileno=os.dup(descriptor))
        self._since = time.monotonic()
        self._over = False
        try:
            here, there = self._socket.getsockname(), self._socket.getpeername()
            place = f":{here[1]}" if isinstance(here, tuple) else f"/{here}"
            if not endpoint.endswith(place):  # ZeroMQ has closed the socket, and its number means another one now
                raise ConnectionAbortedError(f"no connection to {endpoint}")
        except OSError:
            self._socket.close()
            raise
        self.host = str(there[0]) if isinstance(there, tuple) else ""

    def sent(self) -> int:
        """Bytes that the other side has sent; 0 for connections through a file."""
        if not self.host:
            return 0
        info = self._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _BYTES_RECEIVED.size)
        count: int = _BYTES_RECEIVED.unpack(info)[0]
        return count

    def exceeds(self) -> bool:
        """Whether it has sent more than it may, and we have not hung up yet."""
        return not self._over and self.sent() > _ALLOWED_BYTES + _ALLOWED_BYTES_PER_S * (time.monotonic() - self._since)

    def has_left(self) -> bool:
        """Whether the connection has not been ended by ZeroMQ, but by the other side or by us."""
        try:
            if self.host and self._socket.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0] != _ESTABLISHED:
                return True  # there may be bytes left that it sent before
            return self._over or not self._socket.recv(1, socket.MSG_PEEK | socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        except OSError:
            return True

    def hang_up(self) -> None:
        """End the connection, for ZeroMQ as well."""
        self._over = True
        _shut_down(self._socket)

    def close(self) -> None:
        """Close our descriptor."""
        self._socket.close()


def _shut_down(connection: socket.socket) -> None:
    with suppress(OSError):  # it has ended already
        connection.shutdown(socket.SHUT_RDWR)


class Peers:
    """The connections to one socket. Any thread may call the methods.

    Args:
        publishing: the socket, before it is bound.
    """

    def __init__(self, publishing: "zmq.Socket[bytes]") -> None:
        self._publishing = publishing
        self._monitor = publishing.get_monitor_socket(_EVENTS)
        self._peers: dict[int, _Peer] = {}
        self._closed_to: dict[str, float] = {}
        self._refused: Counter[str] = Counter()
        self._lock = threading.Lock()
        # A daemon: a process whose main thread fails must end.
        self._thread = threading.Thread(target=self._watch, name="subscribers", daemon=True)
        self._thread.start()

    def refused(self) -> dict[str, int]:
        """The number of connections that were closed since the last call, by the reason in words."""
        with self._lock:
            refused, self._refused = self._refused, Counter()
        return dict(refused)

    def hang_up_on_loudest(self) -> None:
        """Close the connection that has sent the most bytes."""
        with self._lock:
            if self._peers:
                self._hang_up(max(self._peers.values(), key=_Peer.sent), "subscribed to too many topics")

    def close(self) -> None:
        """Stop watching; before the socket is closed. A second call does nothing."""
        if self._thread.is_alive():
            self._publishing.disable_monitor()
            self._thread.join(_JOIN_S)

    def _watch(self) -> None:
        watching, next_look = True, 0.0
        while watching:
            if self._monitor.poll(round(_LOOK_S * 1000) if self._peers else None):
                event, endpoint = self._monitor.recv_multipart()
                kind, descriptor = _EVENT.unpack(event)
                watching = kind != zmq.EVENT_MONITOR_STOPPED
                with self._lock:
                    self._hear(kind, descriptor, endpoint.decode())
            if time.monotonic() >= next_look:
                next_look = time.monotonic() + _LOOK_S
                self._look()
        self._monitor.close()
        for peer in self._peers.values():
            peer.close()

    def _hear(self, kind: int, descriptor: int, endpoint: str) -> None:
        """Handle an event of the socket."""
        if (gone := self._peers.pop(descriptor, None)) is not None:
            if kind == zmq.EVENT_DISCONNECTED and not gone.has_left():
                self._refused["sent a long message, or speaks no ZeroMQ"] += 1
            gone.close()
        if kind != zmq.EVENT_ACCEPTED:
            return
        try:
            peer = self._peers[descriptor] = _Peer(descriptor, endpoint)
        except OSError as error:
            if error.errno in {errno.EMFILE, errno.ENFILE}:
                self._refused["came when no file could be opened any more"] += 1
                borrowed = socket.socket(fileno=descriptor)
                _shut_down(borrowed)
                borrowed.detach()
            return
        if len(self._peers) > MOST_PEERS:
            self._hang_up(peer, f"came when {MOST_PEERS} were connected")
        elif peer.host in self._closed_to:
            self._hang_up(peer, "came from an address that had sent too much")

    def _look(self) -> None:
        """Close the connections that have sent too much."""
        now = time.monotonic()
        with self._lock:
            self._closed_to = {host: until for host, until in self._closed_to.items() if until > now}
            for peer in self._peers.values():
                if peer.exceeds():
                    self._closed_to[peer.host] = now + _CLOSED_S
                    self._hang_up(peer, "sent too much")

    def _hang_up(self, peer: _Peer, why: str) -> None:
        self._refused[why] += 1
        peer.hang_up()
