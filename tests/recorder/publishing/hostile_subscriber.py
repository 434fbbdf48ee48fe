"""A subscriber that means harm: `python -m … KIND ADDRESS NUMBER`; ends when its standard input is closed.

Kinds: `long` subscribes to one topic of NUMBER bytes, `many` to NUMBER topics, `flood` sends subscriptions and their
cancellations without end, `chatter` messages that are no subscriptions, `crowd` opens NUMBER connections.
"""

import select
import socket
import struct
import sys
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from itertools import repeat

import zmq

_GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00NULL" + bytes(16 + 1 + 31)
_READY = b"\x05READY\x0bSocket-Type\x00\x00\x00\x03SUB"


def _frame(body: bytes, flags: int = 0) -> bytes:
    return bytes([flags, len(body)]) + body if len(body) < 256 else struct.pack(">BQ", flags | 2, len(body)) + body


def _connected(address: str) -> socket.socket:
    host, port = address.removeprefix("tcp://").rsplit(":", 1)
    return socket.create_connection((host, int(port)), timeout=10)


def _shaken(address: str) -> socket.socket:
    """A connection after the handshake."""
    sock = _connected(address)
    sock.sendall(_GREETING + _frame(_READY, flags=4))
    sock.recv(4096)
    return sock


def _subscribe(address: str, topics: Iterator[bytes]) -> None:
    with zmq.Context() as context, context.socket(zmq.SUB) as sub:
        sub.linger = 0
        sub.connect(address)
        for topic in topics:
            sub.subscribe(topic)
        _say_done()
        while not _over(0.0):  # SUB sends subscriptions again whenever it is connected again
            sub.poll(50)


def _pour(address: str, pieces: Iterator[bytes]) -> None:
    """Send as fast as it is taken, over a new connection whenever one is closed."""
    _say_done()
    while not _over(0.01):
        with suppress(OSError), _shaken(address) as sock:
            for piece in pieces:
                sock.sendall(piece)


def _crowd(address: str, number: int) -> None:
    with ExitStack() as stack:
        for _ in range(number):
            with suppress(OSError):
                stack.enter_context(_connected(address))
        _say_done()
        while not _over(1.0):
            pass


def _say_done() -> None:
    sys.stdout.write("done\n")
    sys.stdout.flush()


def _over(wait_s: float) -> bool:
    return bool(select.select([sys.stdin], [], [], wait_s)[0])


def main(kind: str, address: str, number: int) -> None:
    """Do harm."""
    match kind:
        case "long":
            _subscribe(address, iter([b"x" * number]))
        case "many":
            _pour(address, (_frame(b"\x01topic %d" % each) for each in range(number)))
        case "flood":
            _pour(address, repeat((_frame(b"\x01event") + _frame(b"\x00event")) * 2000))
        case "chatter":
            _pour(address, repeat(_frame(b"x" * 200) * 500))
        case "crowd":
            _crowd(address, number)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
