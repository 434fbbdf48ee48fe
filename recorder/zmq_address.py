"""Binding ZeroMQ sockets, with errors that say what to do."""

import errno
import socket as sockets
from pathlib import Path

import zmq

from rig.errors import BadInputError
from rig.topics import Topic

_IPC = "ipc://"


def live_topic(topic: Topic) -> bytes:
    """First part of the messages of a topic.

    Raises:
        ValueError: the topic is not published on its own.
    """
    if topic.live is None:
        raise ValueError(f"{topic.name} is not published on its own")
    return topic.live.encode()


def bind(socket: zmq.Socket[bytes], address: str) -> str:
    """Bind `socket` to `address`.

    Returns:
        The address it is bound to; an open port (`tcp://127.0.0.1:*`) is filled in.

    Raises:
        BadInputError: the address is in use, not of this machine, or none at all.
    """
    if _somebody_listens(address):
        raise _in_use(address)
    try:
        socket.bind(address)
    except zmq.ZMQError as error:
        if error.errno == zmq.EADDRINUSE:
            raise _in_use(address) from None
        reason = zmq.strerror(error.errno or 0)
        raise BadInputError(f"{address}: cannot be bound ({reason}); use e.g. tcp://127.0.0.1:5556") from None
    return socket.get_string(zmq.LAST_ENDPOINT)


def _in_use(address: str) -> BadInputError:
    return BadInputError(f"{address}: address in use; stop the other publisher or choose another address")


def _somebody_listens(address: str) -> bool:
    """Whether an `ipc://` address is served: ZeroMQ would take it over without a word."""
    path = address.removeprefix(_IPC)
    if path == address or not Path(path).exists():
        return False
    with sockets.socket(sockets.AF_UNIX, sockets.SOCK_STREAM) as probe:
        probe.settimeout(1.0)
        return probe.connect_ex(path) not in (errno.ECONNREFUSED, errno.ENOENT)
