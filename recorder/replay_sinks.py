"""Where a replay sends to: a publisher as in live operation, or a queue for workers that loses nothing."""

import threading
import time
from typing import Protocol

import zmq

from recorder.publisher import Publisher
from recorder.zmq_address import bind

_POLL_S = 0.1
_LINGER_S = 5.0
#: Replayed images are copied, so a subscriber's queue costs memory, not slots.
_QUEUE = 64


class Sink(Protocol):
    """Takes multipart messages.

    Attributes:
        address: where it is bound.
    """

    address: str

    def wait(self, timeout_s: float, stop: threading.Event) -> bool:
        """Wait for the first subscriber or worker; False if none came in time."""

    def send(self, parts: list[bytes | memoryview], stop: threading.Event) -> bool:
        """Send one message; False if it was stopped before the message was taken."""

    def finish(self, stop: threading.Event) -> None:
        """Wait until what was sent has been taken."""

    def close(self) -> None:
        """Drop what has not been taken; a second call does nothing."""


class PublishSink:
    """Publishes as in live operation: never waits, and who is too slow misses messages."""

    def __init__(self, address: str) -> None:
        self._publisher = Publisher(address, queue=_QUEUE)
        self.address = self._publisher.address

    def wait(self, timeout_s: float, stop: threading.Event) -> bool:
        """Wait for the first subscriber to triplets."""
        deadline = time.monotonic() + timeout_s
        while not stop.is_set() and time.monotonic() < deadline:
            if self._publisher.wait_for_subscriber(_POLL_S):
                return True
        return False

    def send(self, parts: list[bytes | memoryview], stop: threading.Event) -> bool:
        """Publish."""
        self._publisher.parts(parts)
        return not stop.is_set()

    def finish(self, stop: threading.Event) -> None:
        """Give subscribers a few seconds to take the rest."""
        self._publisher.close(0.0 if stop.is_set() else _LINGER_S)

    def close(self) -> None:
        """Unbind."""
        self._publisher.close()


class PushSink:
    """Deals messages out to workers (PULL sockets) and waits for them, however slow they are.

    A worker that dies takes the few messages with it that were on the way to it.
    """

    def __init__(self, address: str) -> None:
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.PUSH)
        self._socket.sndhwm = 1
        self._socket.linger = 0
        try:
            self.address = bind(self._socket, address)
        except BaseException:
            self.close()
            raise

    def wait(self, timeout_s: float, stop: threading.Event) -> bool:
        """Wait for the first worker."""
        deadline = time.monotonic() + timeout_s
        while not stop.is_set() and time.monotonic() < deadline:
            if self._socket.poll(round(_POLL_S * 1000), zmq.POLLOUT):
                return True
        return False

    def send(self, parts: list[bytes | memoryview], stop: threading.Event) -> bool:
        """Wait until a worker has room, then send."""
        while not stop.is_set():
            if self._socket.poll(round(_POLL_S * 1000), zmq.POLLOUT):
                self._socket.send_multipart(parts, zmq.DONTWAIT)
                return True
        return False

    def finish(self, stop: threading.Event) -> None:
        """Wait until the workers have taken everything, or `stop`."""
        if stop.is_set():
            return
        self._socket.close(linger=-1)
        # ZeroMQ ends its context only when all is delivered, and cannot be asked how far it is.
        ending = threading.Thread(target=self._context.term, name="replay delivers", daemon=True)
        ending.start()
        while ending.is_alive() and not stop.is_set():
            ending.join(_POLL_S)

    def close(self) -> None:
        """Unbind."""
        if not self._socket.closed:
            self._context.destroy(linger=0)
