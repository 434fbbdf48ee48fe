"""The wire between a process and one of its children: typed messages as lines of JSON over a socket pair.

It is also the lifeline: when either side dies, the other reads the end of the stream.
"""

import select
import socket
import time
from collections import deque
from typing import Any, Generic, TypeVar

from rig.transport import wire

Incoming = TypeVar("Incoming")


class ControlChannel(Generic[Incoming]):
    """One end of the wire.

    Args:
        sock: a connected stream socket; the channel closes it.
        incoming: type of the messages from the other side, or union of tagged types.
    """

    def __init__(self, sock: socket.socket, incoming: Any) -> None:
        self._socket = sock
        self._socket.setblocking(True)
        self._decoder = wire.decoder(incoming)
        self._pending: list[bytes] = []  # pieces of a message that has not come whole
        self._unread: deque[Incoming] = deque()
        self._ended = False

    def fileno(self) -> int:
        """For select and poll."""
        return self._socket.fileno()

    @property
    def ended(self) -> bool:
        """Whether the other side is gone."""
        return self._ended

    def send(self, message: object, *, or_drop: bool = False) -> bool:
        """Send one message.

        Args:
            message: a value that `rig.transport.wire` can encode.
            or_drop: drop the message if the other side does not read, for messages that are sent anew again and again.

        Returns:
            False if the message was dropped or the other side is gone.
        """
        if self._ended:
            return False
        # The kernel calls a stream socket writable while most of its buffer is free: a message then fits whole.
        if or_drop and not select.select([], [self._socket], [], 0)[1]:
            return False
        try:
            self._socket.sendall(wire.encode(message) + b"\n")
        except (BrokenPipeError, ConnectionResetError):
            self._ended = True
            return False
        return True

    def receive(self, timeout_s: float) -> list[Incoming]:
        """All messages that have come, waiting at most `timeout_s` seconds for the first.

        Returns:
            An empty list if none came in time; see also `ended`.

        Raises:
            msgspec.MsgspecError: the other side sent something else than the expected messages.
        """
        messages = [*self._unread, *self._read(0 if self._unread else timeout_s)]
        self._unread.clear()
        return messages

    def next(self, timeout_s: float) -> Incoming | None:
        """The next message, waiting for it at most `timeout_s` seconds.

        Returns:
            None if no message came in time or the other side is gone; see `ended`.

        Raises:
            msgspec.MsgspecError: as `receive`.
        """
        deadline = time.monotonic() + timeout_s
        while not self._unread and not self._ended:
            left_s = deadline - time.monotonic()
            self._unread.extend(self._read(max(0.0, left_s)))
            if left_s <= 0:
                break
        return self._unread.popleft() if self._unread else None

    def _read(self, timeout_s: float) -> list[Incoming]:
        if self._ended or not select.select([self._socket], [], [], timeout_s)[0]:
            return []
        try:
            data = self._socket.recv(1 << 16)
        except ConnectionResetError:
            data = b""
        self._ended = not data
        first, *more = data.split(b"\n")
        self._pending.append(first)
        if not more:
            return []
        lines = (b"".join(self._pending), *more[:-1])
        self._pending = [more[-1]]
        return [self._decoder.decode(line) for line in lines]

    def close(self) -> None:
        """Close this end; afterwards nothing can be sent or received."""
        self._ended = True
        self._socket.close()
