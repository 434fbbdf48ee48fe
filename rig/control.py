"""The wire between the service process and one of its children: JSON lines over a socket pair.

It is also the lifeline. When either side dies the other reads the end of the stream, so a child never outlives
its parent for long, however that ended.
"""

import json
import select
import socket
from typing import Any

Message = dict[str, Any]


class ControlChannel:
    """One end of the wire."""

    def __init__(self, sock: socket.socket) -> None:
        self._socket = sock
        self._socket.setblocking(True)
        self._pending = b""
        self._ended = False

    def fileno(self) -> int:
        """For select and poll."""
        return self._socket.fileno()

    @property
    def ended(self) -> bool:
        """The other side is gone."""
        return self._ended

    def send(self, message: Message, *, or_drop: bool = False) -> bool:
        """Send one message.

        Args:
            message: what to send.
            or_drop: do not wait if the other side does not read: a later message says the same anew.

        Returns:
            False if it was dropped or the other side is gone.
        """
        # The kernel calls a stream socket writable while most of its buffer is free: a message then fits whole.
        if or_drop and not select.select([], [self._socket], [], 0)[1]:
            return False
        try:
            self._socket.sendall(json.dumps(message).encode() + b"\n")
        except (BrokenPipeError, ConnectionResetError):
            self._ended = True
            return False
        return True

    def receive(self, timeout_s: float) -> list[Message]:
        """All messages that are there, waiting at most `timeout_s` seconds for the first.

        Returns:
            An empty list if none came in time; see also `ended`.
        """
        if not self._ended and select.select([self._socket], [], [], timeout_s)[0]:
            try:
                data = self._socket.recv(1 << 16)
            except ConnectionResetError:
                data = b""
            self._ended = not data
            self._pending += data
        *lines, self._pending = self._pending.split(b"\n")
        return [json.loads(line) for line in lines]

    def close(self) -> None:
        """Close this end."""
        self._socket.close()
