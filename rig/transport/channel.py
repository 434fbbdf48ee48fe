"""The wire between a process and one of its children: typed messages as lines of JSON over a socket pair.

It is also the lifeline: when either side dies, the other reads the end of the stream.

Nobody ever waits for the other side to read. What the socket does not take waits in a queue of limited size, and goes
out later: `send`, `flush` and every wait for messages write as much of it as the socket takes.
"""

import select
import socket
import time
from collections import deque
from typing import Any, Final, Generic, TypeVar

from rig.transport import wire
from rig.transport.message import Message

Incoming = TypeVar("Incoming")

#: Bytes of messages that may wait for a side that does not read; a single larger message may wait alone.
QUEUE_BYTES: Final = 4 << 20


class ControlChannel(Generic[Incoming]):
    """One end of the wire.

    Args:
        sock: a connected stream socket; the channel closes it.
        incoming: type of the messages from the other side, or union of tagged types.

    Attributes:
        dropped: number of messages that found the queue full, without those that a later one of their kind replaced.
    """

    def __init__(self, sock: socket.socket, incoming: Any) -> None:
        self._socket = sock
        self._socket.setblocking(False)
        self._decoder = wire.decoder(incoming)
        self._pending: list[bytes] = []  # pieces of a message that has not come whole
        self._unread: deque[Incoming] = deque()
        self._outgoing = _Outgoing()
        self._ended = False

    def fileno(self) -> int:
        """For select and poll."""
        return self._socket.fileno()

    @property
    def ended(self) -> bool:
        """Whether the other side is gone."""
        return self._ended

    @property
    def waiting(self) -> bool:
        """Whether messages wait until the socket takes them."""
        return bool(self._outgoing) and not self._ended

    @property
    def dropped(self) -> int:
        """See the attributes of the class."""
        return self._outgoing.dropped

    def send(self, message: object) -> bool:
        """Send one message, or let it wait until the other side reads; never blocks.

        While the other side does not read, a message that tells a state (`Message.is_state`) replaces the waiting one
        of its type. If the queue is full, the oldest waiting messages are dropped and counted.

        Args:
            message: a value that `rig.transport.wire` can encode.

        Returns:
            False if the other side is gone.
        """
        if self._ended:
            return False
        state = type(message) if isinstance(message, Message) and message.is_state else None
        self._outgoing.add(wire.encode(message) + b"\n", state)
        self.flush()
        return not self._ended

    def flush(self) -> None:
        """Write as much of what waits as the socket takes now."""
        while self.waiting:
            try:
                self._outgoing.written(self._socket.send(self._outgoing.next()))
            except BlockingIOError:
                return
            except (BrokenPipeError, ConnectionResetError):
                self._ended = True

    def drain(self, timeout_s: float) -> None:
        """Write all that waits, for at most `timeout_s` seconds: before the end of a process."""
        deadline = time.monotonic() + timeout_s
        while self.waiting and (left_s := deadline - time.monotonic()) > 0:
            poll = select.poll()
            poll.register(self._socket, select.POLLOUT)
            poll.poll(left_s * 1000)
            self.flush()

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
        if not self._readable(timeout_s):
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

    def _readable(self, timeout_s: float) -> bool:
        """Wait for something to read, at most `timeout_s`, and write what waits meanwhile."""
        deadline = time.monotonic() + timeout_s
        while not self._ended:
            poll = select.poll()
            poll.register(self._socket, select.POLLIN | (select.POLLOUT if self.waiting else 0))
            left_s = max(0.0, deadline - time.monotonic())
            ready = dict(poll.poll(left_s * 1000)).get(self.fileno(), 0)
            if ready & select.POLLOUT:
                self.flush()
            if ready & ~select.POLLOUT:
                return True
            if not left_s:
                break
        return False

    def close(self) -> None:
        """Close this end; afterwards nothing can be sent or received."""
        self._ended = True
        self._socket.close()


class _Outgoing:
    """Messages that wait for the socket. One that is written in part stays, whatever comes."""

    def __init__(self) -> None:
        self._messages: list[tuple[bytes, type | None]] = []
        self._offset = 0  # so much of the first message is written
        self.dropped = 0

    def __bool__(self) -> bool:
        return bool(self._messages)

    def add(self, message: bytes, state: type | None) -> None:
        """Append a message.

        Args:
            message: encoded, with its end of line.
            state: type of a message that tells a state, of which the latest counts; None for any other message.
        """
        begun = self._messages[:1] if self._offset else []
        rest = [each for each in self._messages[len(begun) :] if state is None or each[1] is not state]
        size = sum(len(each) for each, _ in begun + rest) + len(message)
        while rest and size > QUEUE_BYTES:
            oldest, kind = rest.pop(0)
            size -= len(oldest)
            self.dropped += kind is None
        self._messages = [*begun, *rest, (message, state)]

    def next(self) -> memoryview:
        """What is to be written next."""
        return memoryview(self._messages[0][0])[self._offset :]

    def written(self, size: int) -> None:
        """Note that the socket took so many bytes of `next`."""
        self._offset += size
        if self._offset == len(self._messages[0][0]):
            del self._messages[0]
            self._offset = 0
