"""The bus's end of the connection to the shim (`shim/bus.h`): one packet per request, one per reply."""

import os
import socket
import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

#: Environment variable that tells the shim the name of the bus's socket.
VARIABLE: Final = "SVEV_FIREWIRE_BUS"
_MESSAGE_BYTES: Final = 1 << 15
_REQUEST: Final = struct.Struct("=IIII")
_REPLY: Final = struct.Struct("=iII")
_NO_DESCRIPTOR: Final = -1


class Operation(IntEnum):
    """Kinds of request."""

    LIST = 1
    OPEN = 2
    IOCTL = 3
    MMAP = 4


_WITH_DESCRIPTOR: Final = frozenset({Operation.OPEN, Operation.MMAP})


@dataclass(frozen=True, slots=True)
class Request:
    """One request.

    Attributes:
        operation: kind of request.
        code: code of an ioctl.
        argument: argument of an ioctl, as in memory.
        extra: data that the argument points to.
        descriptor: descriptor that came along, -1 if none; the receiver closes it.
    """

    operation: Operation
    code: int
    argument: bytes
    extra: bytes
    descriptor: int


def receive(connection: socket.socket) -> Request | None:
    """Receive one request; None at the end of the connection, or if the packet is no request of the shim."""
    try:
        data, descriptors, _, _ = socket.recv_fds(connection, _MESSAGE_BYTES, 1)
    except ConnectionResetError:
        return None
    descriptor = descriptors[0] if descriptors else _NO_DESCRIPTOR
    request = _parsed(data, descriptor)
    if request is None and descriptor != _NO_DESCRIPTOR:
        os.close(descriptor)
    return request


def _parsed(data: bytes, descriptor: int) -> Request | None:
    if len(data) < _REQUEST.size:
        return None
    operation, code, argument_bytes, extra_bytes = _REQUEST.unpack_from(data)
    middle = _REQUEST.size + argument_bytes
    complete = len(data) == middle + extra_bytes and (descriptor != _NO_DESCRIPTOR) == (operation in _WITH_DESCRIPTOR)
    if operation not in set(Operation) or not complete:
        return None
    return Request(Operation(operation), code, data[_REQUEST.size : middle], data[middle:], descriptor)


def reply(connection: socket.socket, result: int, argument: bytes = b"", extra: bytes = b"") -> None:
    """Answer a request; does nothing if its sender is gone."""
    try:
        connection.send(_REPLY.pack(result, len(argument), len(extra)) + argument + extra)
    except (BrokenPipeError, ConnectionResetError):
        return  # the next `receive` reports the end of the connection


def owner(connection: socket.socket) -> int:
    """User id of the process at the other end."""
    credentials = connection.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("=iII"))
    user: int = struct.unpack("=iII", credentials)[1]
    return user
