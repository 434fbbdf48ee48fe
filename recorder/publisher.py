"""Publishes triplets, events and health over ZeroMQ; never blocks, never copies an image, counts what it drops.

To subscribers the socket is a PUB socket. It is an XPUB, because that is told what is subscribed to: without a
subscriber for images nothing is handed to ZeroMQ at all.
"""

import json
import threading
import time
import weakref
from collections.abc import Mapping
from typing import Any

import zmq

from recorder.triplet_buffers import TripletBuffers
from recorder.zmq_address import bind, live_topic
from rig.errors import BadInputError
from rig.topics import EVENTS, HEALTH, TRIPLET

_TRIPLET = live_topic(TRIPLET)
_EVENT = live_topic(EVENTS)
_HEALTH = live_topic(HEALTH)
_SUBSCRIBE = b"\x01"
#: Slots that publication leaves to assembly and disk, at least.
_SPARE_SLOTS = 4


class Publisher:
    """One bound socket. Methods may be called from one thread.

    A subscriber that reads too slowly misses triplets: ZeroMQ drops them for it alone beyond `queue`, so one that
    stands still holds at most `queue` slots. However many stand still, a quarter of the slots is never theirs.

    Attributes:
        address: where it is bound; a port that was left open (`tcp://127.0.0.1:*`) is filled in.
        sent: triplets handed to ZeroMQ, where anybody wanted them.
        dropped: triplets that were wanted and that nobody got, because too many slots were still being sent.
    """

    def __init__(self, address: str, ipc: str | None = None, *, queue: int = 8) -> None:
        """Bind.

        Args:
            address: `tcp://HOST:PORT` or `ipc://PATH`.
            ipc: a second address, `ipc://PATH`.
            queue: messages that may wait for one subscriber.

        Raises:
            BadInputError: an address is in use, or not of this machine.
        """
        self.sent = 0
        self.dropped = 0
        self._queue = queue
        self._held = 0
        self._lock = threading.Lock()
        self._subscriptions: set[bytes] = set()
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.XPUB)
        self._socket.sndhwm = queue
        try:
            self.address = bind(self._socket, address)
            if ipc is not None:
                bind(self._socket, ipc)
        except BadInputError:
            self.close()
            raise

    @property
    def held(self) -> int:
        """Slots that are with ZeroMQ at the moment."""
        return self._held

    @property
    def busy(self) -> bool:
        """Whether the slowest subscriber's queue may be half full."""
        return self._held > self._queue // 2

    def wait_for_subscriber(self, timeout_s: float) -> bool:
        """Wait until somebody subscribes to triplets; False if nobody has within `timeout_s`."""
        deadline = time.monotonic() + timeout_s
        while not self._wanted(_TRIPLET):
            left = deadline - time.monotonic()
            if left <= 0:
                return False
            self._socket.poll(round(left * 1000) + 1)
        return True

    def triplet(self, tag: bytes, buffers: TripletBuffers, slot: int | None) -> None:
        """Publish a triplet without copying it; the slot is held until ZeroMQ has let go of it.

        Args:
            tag: the encoded tag.
            buffers: whose slot it is.
            slot: held by the caller during the call; its pixels must not change while anybody holds it. None for a
                pulse without pixels: the image part is empty.
        """
        if not self._wanted(_TRIPLET):
            return
        if slot is None:
            self.parts([_TRIPLET, tag, b""])
            return
        if self._held >= buffers.count - max(_SPARE_SLOTS, buffers.count // 4):
            self.dropped += 1
            return
        buffers.hold(slot)
        with self._lock:
            self._held += 1
        # ZeroMQ keeps this very view while it needs the pixels; when the view dies, it is done with them.
        view = buffers.pixels(slot).data
        weakref.finalize(view, self._let_go, buffers, slot)
        self._socket.send_multipart([_TRIPLET, tag, view], zmq.DONTWAIT, copy=False)
        self.sent += 1

    def parts(self, parts: list[bytes | memoryview]) -> None:
        """Publish a message as it is, topic first; its parts are copied."""
        if self._wanted(bytes(parts[0])):
            self._socket.send_multipart(parts, zmq.DONTWAIT)
            self.sent += parts[0] == _TRIPLET

    def event(self, event: Mapping[str, Any]) -> None:
        """Publish an event (`recorder.events.Event.to_json`)."""
        self.parts([_EVENT, _encode(event)])

    def health(self, health: Mapping[str, Any]) -> None:
        """Publish a health record."""
        self.parts([_HEALTH, _encode(health)])

    def close(self, linger_s: float = 0.0) -> None:
        """Unbind and let go of all slots; a second call does nothing.

        Args:
            linger_s: wait so long for slow subscribers; what they have not got by then, they miss.
        """
        self._context.destroy(linger=round(linger_s * 1000))

    def _wanted(self, topic: bytes) -> bool:
        """Whether anybody has subscribed to `topic`."""
        while self._socket.poll(0):
            change = self._socket.recv(zmq.DONTWAIT)
            if change[:1] == _SUBSCRIBE:
                self._subscriptions.add(change[1:])
            else:
                self._subscriptions.discard(change[1:])
        return any(topic.startswith(prefix) for prefix in self._subscriptions)

    def _let_go(self, buffers: TripletBuffers, slot: int) -> None:
        """Called from ZeroMQ's own thread when it no longer needs the slot."""
        with self._lock:
            self._held -= 1
        buffers.release(slot)


def _encode(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, separators=(",", ":")).encode()
