"""Binding ZeroMQ sockets, with errors that say what to do."""

import errno
import socket as sockets
from pathlib import Path

import zmq

from rig.errors import BadInputError
from rig.topics import DEFAULT_PUBLISH, Topic

_IPC = "ipc://"
_LAST_PORT = 65535


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
    return BadInputError(f"{address}: address in use; stop the other publisher or choose another address")


def _not_bound(address: str, reason: str) -> BadInputError:
    return BadInputError(f"{address}: cannot be bound ({reason}); use e.g. {DEFAULT_PUBLISH}")


def _somebody_listens(address: str) -> bool:
    """Whether an `ipc://` address is served: ZeroMQ would take it over without a word."""
    path = address.removeprefix(_IPC)
    if path == address or not Path(path).exists():
        return False
    with sockets.socket(sockets.AF_UNIX, sockets.SOCK_STREAM) as probe:
        probe.settimeout(1.0)
        return probe.connect_ex(path) not in (errno.ECONNREFUSED, errno.ENOENT)
