"""Receives triplets: from a publisher, live or replayed (SUB), or dealt out by a reliable replay (PULL)."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import zmq
from zmq.auth import load_certificate

from rig.errors import BadInputError
from rig.images.pixels import Stored
from rig.tag import TripletTag
from rig.topics import TRIPLET

#: Triplets that wait while the worker computes: 8 s of three VGA cameras at 30 Hz, 240 MB.
_QUEUE: Final = 256
_TOPIC: Final = (TRIPLET.live or "").encode()


@dataclass(frozen=True, slots=True)
class Source:
    """Where triplets come from.

    Attributes:
        address: ZeroMQ address to connect to.
        reliable: it is a reliable replay, which deals out each triplet to one worker.
        public_key: the publisher's public key; None: it publishes without keys.
    """

    address: str
    reliable: bool = False
    public_key: bytes | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Received:
    """A triplet.

    Attributes:
        tag: what became of the pulse.
        image: (rows, columns), as stored; None if no camera delivered a frame.
    """

    tag: TripletTag
    image: Stored | None


class Stream:
    """An open connection; made by `connected`.

    Attributes:
        refused: messages that were no triplets of ours.
    """

    def __init__(self, socket: "zmq.Socket[bytes]") -> None:
        self._socket = socket
        self.refused = 0

    def next(self, timeout_s: float, wake: int | None = None) -> Received | None:
        """The next triplet; None if none comes within `timeout_s`, or if what comes is none.

        Args:
            timeout_s: how long to wait.
            wake: a descriptor; as soon as it can be read, nothing is waited for.
        """
        poller = zmq.Poller()
        poller.register(self._socket, zmq.POLLIN)
        if wake is not None:
            poller.register(wake, zmq.POLLIN)
        if self._socket not in dict(poller.poll(round(timeout_s * 1000))):
            return None
        parts = self._socket.recv_multipart(copy=False)
        if parts[0].bytes != _TOPIC:
            return None
        received = _triplet([part.buffer for part in parts[1:]])
        self.refused += received is None
        return received


@contextmanager
def connected(source: Source) -> Iterator[Stream]:
    """Connect; within the context triplets are received.

    Raises:
        BadInputError: the address is none of ZeroMQ.
    """
    with zmq.Context() as context, context.socket(zmq.PULL if source.reliable else zmq.SUB) as socket:
        socket.rcvhwm = 1 if source.reliable else _QUEUE
        socket.linger = 0
        if source.public_key is not None:
            socket.curve_publickey, socket.curve_secretkey = zmq.curve_keypair()
            socket.curve_serverkey = source.public_key
        if not source.reliable:
            socket.setsockopt(zmq.SUBSCRIBE, _TOPIC)
        try:
            socket.connect(source.address)
        except zmq.ZMQError as error:
            raise BadInputError(
                f"{source.address}: cannot connect ({error.strerror}); give an address such as tcp://127.0.0.1:5556"
            ) from None
        yield Stream(socket)


def public_key(path: Path) -> bytes:
    """The publisher's public key from a file of `svev keys`.

    Raises:
        BadInputError: the file is missing or holds no key.
    """
    try:
        key, _ = load_certificate(path)
    except (OSError, ValueError, IndexError):
        raise BadInputError(f"{path}: holds no public key; take the file .key that svev keys has made") from None
    return bytes(key)


def _triplet(parts: list[memoryview]) -> Received | None:
    """A triplet from the parts behind its topic; None if they are none."""
    if len(parts) != 2:
        return None
    try:
        tag = TripletTag.decode(parts[0])
        kind = tag.pixels
    except ValueError:
        return None
    if not len(parts[1]):
        return Received(tag, None)
    if len(parts[1]) != tag.shape[0] * tag.shape[1] * kind.size:
        return None
    return Received(tag, np.frombuffer(parts[1], kind.dtype).reshape(tag.shape))
