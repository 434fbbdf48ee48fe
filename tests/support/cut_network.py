"""A way to a server on loopback that can be cut: its connections are reset, and those that come, until it is healed."""

import selectors
import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

#: Linger for no time: what waits is thrown away, and the other side sees a reset.
_RESET: Final = struct.pack("ii", 1, 0)
_LOOK_S: Final = 0.02
_SEND_S: Final = 60.0
_PIECE: Final = 1 << 18


class Way:
    """The way, and the thread that carries what goes over it.

    Attributes:
        port: where it begins, on the server's host.
    """

    def __init__(self, host: str, port: int) -> None:
        self._to = host, port
        self._listener = socket.create_server((host, 0))
        self.port: int = self._listener.getsockname()[1]
        self._is_cut, self._closed = threading.Event(), threading.Event()
        self._selector = selectors.DefaultSelector()
        self._others: dict[socket.socket, socket.socket] = {}
        self._thread = threading.Thread(target=self._carry, name="way", daemon=True)
        self._thread.start()

    def cut(self) -> None:
        """Reset all connections, and those to come."""
        self._is_cut.set()

    def heal(self) -> None:
        """Let connections come again."""
        self._is_cut.clear()

    def close(self) -> None:
        """End it, and the thread."""
        self._closed.set()
        self._thread.join()

    def _carry(self) -> None:
        with self._selector, self._listener:
            self._selector.register(self._listener, selectors.EVENT_READ)
            while not self._closed.is_set():
                for key, _ in self._selector.select(_LOOK_S):
                    if key.fileobj is self._listener:
                        self._begin()
                    elif isinstance(key.fileobj, socket.socket) and key.fileobj in self._others:
                        self._pass_on(key.fileobj)
                if self._is_cut.is_set():
                    self._reset()
            self._reset()

    def _begin(self) -> None:
        client, _ = self._listener.accept()
        server = socket.create_connection(self._to)
        self._others.update({client: server, server: client})
        for each in (client, server):
            each.settimeout(_SEND_S)
            self._selector.register(each, selectors.EVENT_READ)

    def _pass_on(self, one: socket.socket) -> None:
        with suppress(ConnectionError):
            if piece := one.recv(_PIECE):
                self._others[one].sendall(piece)
                return
        self._end(one)

    def _reset(self) -> None:
        while self._others:
            self._end(next(iter(self._others)))

    def _end(self, one: socket.socket) -> None:
        for each in (one, self._others.pop(one)):
            self._others.pop(each, None)
            self._selector.unregister(each)
            each.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET)
            each.close()


@contextmanager
def cut_network(host: str, port: int) -> Iterator[Way]:
    """A way to a server."""
    way = Way(host, port)
    try:
        yield way
    finally:
        way.close()
