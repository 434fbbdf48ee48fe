"""Publishes triplets, events and health over ZeroMQ; never blocks, never copies an image, counts what it drops.

The socket is an XPUB, which subscribers use like a PUB: an XPUB learns what is subscribed to, so the publisher hands
no image to ZeroMQ while nobody wants images.
"""

import errno
import socket as sockets
import threading
import time
import weakref
from pathlib import Path
from typing import Final

import zmq

from recorder.log.triplet_buffers import TripletBuffers
from recorder.publishing.keys import Keys
from recorder.publishing.peers import Peers
from rig.errors import BadInputError
from rig.events import Event
from rig.phrase import phrase
from rig.topics import DEFAULT_PUBLISH, EVENTS, HEALTH, JUMPER, TRIPLET, Topic
from rig.transport import wire


def live_topic(topic: Topic) -> bytes:
    """First part of the messages of a topic on ZeroMQ.

    Raises:
        ValueError: the topic is not published on its own.
    """
    if topic.live is None:
        raise ValueError(f"{topic.name} is not published on its own")
    return topic.live.encode()


_TRIPLET = live_topic(TRIPLET)
_EVENT = live_topic(EVENTS)
_HEALTH = live_topic(HEALTH)
_JUMPER = live_topic(JUMPER)
_SUBSCRIBE, _CANCEL = b"\x01", b"\x00"
#: Bytes of a message that a subscriber may send: a topic of ours is much shorter, the handshake with keys is 0.5 kB.
_LONGEST_MESSAGE: Final = 1024
#: Bytes of all different topics that are subscribed to; ZeroMQ takes 120 bytes of memory for each.
_TOPICS_BYTES: Final = 64 * 1024
#: Changes of subscriptions that are taken in at once; the next ones wait for the next message.
_CHANGES_AT_ONCE: Final = 64
_HANDSHAKE_MS: Final = 5000
_PATIENCE_S: Final = 1.0
#: At least so many slots are never held for subscribers: assembly and disk need them.
_SPARE_SLOTS = 4
_IPC = "ipc://"
_LAST_PORT = 65535


class Publisher:
    """One bound socket. One thread may call the methods.

    A subscriber that reads too slowly misses triplets: when `queue` messages wait for it, ZeroMQ drops further ones for
    it alone, so a subscriber that stands still holds at most `queue` slots. However many subscribers stand still, they
    never hold the last quarter of the slots.

    Attributes:
        address: where the socket is bound; a port that was left open (`tcp://127.0.0.1:*`) is filled in.
        sent: triplets handed to ZeroMQ, because somebody had subscribed.
        dropped: triplets that were wanted and that nobody got, because too many slots were still being sent.
    """

    def __init__(self, address: str, ipc: str | None = None, *, queue: int = 8, keys: Keys | None = None) -> None:
        """Bind the socket.

        Args:
            address: `tcp://HOST:PORT` or `ipc://PATH`.
            ipc: a second address, `ipc://PATH`.
            queue: messages that may wait for one subscriber.
            keys: serve only subscribers that have the public key; None: everybody.

        Raises:
            BadInputError: an address is in use, or not of this machine.
        """
        self.sent = 0
        self.dropped = 0
        self._queue = queue
        self._held = 0
        self._lock = threading.Lock()
        self._subscriptions: set[bytes] = set()
        self._topics_bytes = 0
        self._next_complaint = 0.0
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.XPUB)
        self._socket.sndhwm = queue
        self._socket.rcvhwm = _CHANGES_AT_ONCE
        self._socket.handshake_ivl = _HANDSHAKE_MS
        if keys is not None:
            keys.guard(self._socket)
        self._peers = Peers(self._socket)
        try:
            self.address = bind(self._socket, address)
            if ipc is not None:
                bind(self._socket, ipc)
        except BadInputError:
            self.close()
            raise

    @property
    def held(self) -> int:
        """Slots that ZeroMQ still needs."""
        return self._held

    @property
    def busy(self) -> bool:
        """Whether the queue of the slowest subscriber may be half full."""
        return self._held > self._queue // 2

    def refused(self) -> dict[str, int]:
        """The number of connections that were closed since the last call, by the reason in words."""
        return self._peers.refused()

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
        """Publish a triplet without copying it; holds the slot until ZeroMQ no longer needs it.

        Args:
            tag: the encoded tag.
            buffers: the buffers that the slot belongs to.
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
        # ZeroMQ keeps this very view while it needs the pixels; when it is done, the view is collected.
        view = buffers.pixels(slot).data
        weakref.finalize(view, self._let_go, buffers, slot)
        self._socket.send_multipart([_TRIPLET, tag, view], zmq.DONTWAIT, copy=False)
        self.sent += 1

    def parts(self, parts: list[bytes | memoryview]) -> None:
        """Publish a message as it is, topic first; copies its parts."""
        if self._wanted(bytes(parts[0])):
            self._socket.send_multipart(parts, zmq.DONTWAIT)
            self.sent += parts[0] == _TRIPLET

    def event(self, event: Event) -> None:
        """Publish an event."""
        self.parts([_EVENT, wire.encode(event)])

    def health(self, health: bytes) -> None:
        """Publish an encoded health record."""
        self.parts([_HEALTH, health])

    def jumper(self, state: bytes) -> None:
        """Publish an encoded state of the jumper."""
        self.parts([_JUMPER, state])

    def close(self, linger_s: float = 0.0) -> None:
        """Unbind and release all slots; a second call does nothing.

        Args:
            linger_s: wait so long for slow subscribers; they miss what they have not received by then.
        """
        if self._socket.closed:
            return
        self._peers.close()
        self._socket.close(round(linger_s * 1000))
        # libzmq 4.3.5 waits forever, and keeps slots, if a subscriber that stood still leaves at this very moment.
        ends = threading.Thread(target=self._context.term, name="publication ends", daemon=True)
        ends.start()
        ends.join(linger_s + _PATIENCE_S)

    def _wanted(self, topic: bytes) -> bool:
        """Whether anybody has subscribed to `topic`."""
        for _ in range(_CHANGES_AT_ONCE):
            if not self._socket.poll(0):
                break
            self._subscription_changed(self._socket.recv(zmq.DONTWAIT))
        if self._topics_bytes > _TOPICS_BYTES and time.monotonic() > self._next_complaint:
            self._next_complaint = time.monotonic() + _PATIENCE_S
            self._peers.hang_up_on_loudest()
        return any(topic[:length] in self._subscriptions for length in range(len(topic) + 1))

    def _subscription_changed(self, change: bytes) -> None:
        """Take in the first subscription to a topic, or the end of the last one."""
        topic = change[1:]
        if change[:1] == _SUBSCRIBE and topic not in self._subscriptions:
            self._subscriptions.add(topic)
            self._topics_bytes += len(topic) + 1
        elif change[:1] == _CANCEL and topic in self._subscriptions:
            self._subscriptions.remove(topic)
            self._topics_bytes -= len(topic) + 1

    def _let_go(self, buffers: TripletBuffers, slot: int) -> None:
        """Called from ZeroMQ's own thread when it no longer needs the slot."""
        with self._lock:
            self._held -= 1
        buffers.release(slot)


def bind(socket: zmq.Socket[bytes], address: str) -> str:
    """Bind `socket` to `address`.

    Returns:
        The address that the socket is bound to; an open port (`tcp://127.0.0.1:*`) is filled in.

    Raises:
        BadInputError: the address is in use, not of this machine, or none at all.
    """
    if _somebody_listens(address):
        raise _in_use(address)
    socket.maxmsgsize = _LONGEST_MESSAGE
    port = address.rpartition(":")[2]
    if port.isdecimal() and int(port) > _LAST_PORT:  # ZeroMQ would bind another one
        raise _not_bound(address, "no such port")
    try:
        socket.bind(address)
    except zmq.ZMQError as error:
        if error.errno == zmq.EADDRINUSE:
            raise _in_use(address) from None
        raise _not_bound(address, zmq.strerror(error.errno or 0)) from None
    return socket.get_string(zmq.LAST_ENDPOINT)


def _in_use(address: str) -> BadInputError:
    text = "{address}: address in use; stop the other publisher or choose another address"
    return BadInputError(phrase("why_address_in_use", text, address=address))


def _not_bound(address: str, reason: str) -> BadInputError:
    text = "{address}: cannot be bound ({why}); use e.g. {example}"
    return BadInputError(phrase("why_not_bound", text, address=address, why=reason, example=DEFAULT_PUBLISH))


def _somebody_listens(address: str) -> bool:
    """Whether another process serves an `ipc://` address: ZeroMQ would take it over without an error."""
    path = address.removeprefix(_IPC)
    if path == address or not Path(path).exists():
        return False
    with sockets.socket(sockets.AF_UNIX, sockets.SOCK_STREAM) as probe:
        probe.settimeout(1.0)
        return probe.connect_ex(path) not in (errno.ECONNREFUSED, errno.ENOENT)
