"""Wire format of GigE Vision action commands and their acknowledges: pure functions, no sockets.

ACTION_CMD and ACTION_ACK of GigE Vision 2.0 (chapters 14 to 16); the same fields and flags stand in Wireshark's
dissector (`packet-gvcp.c`). Every field is big-endian.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from rig.action import ActionKeys
from rig.clocks import DeviceNs

#: Where cameras listen for commands.
GVCP_PORT: Final = 3956
#: Request ids are 1 to this; 0 is refused.
LAST_REQUEST_ID: Final = 0xFFFF

_HEADER: Final = struct.Struct(">BBHHH")  # key, flags, command, length of what follows, request id
_ACK: Final = struct.Struct(">HHHH")  # status, acknowledge, length of what follows, request id
_KEYS: Final = struct.Struct(">III")  # device key, group key, group mask
_TIME: Final = struct.Struct(">Q")  # ticks of the camera's clock
_KEY, _COMMAND, _ACKNOWLEDGE = 0x42, 0x0100, 0x0101
_WANTS_ACK, _SCHEDULED = 0x01, 0x80


class ActionStatus(IntEnum):
    """Statuses of acknowledges that need different things done; there are more."""

    SUCCESS = 0x0000
    NO_REFERENCE_TIME = 0x8013
    OVERFLOW = 0x8015
    LATE = 0x8016


@dataclass(frozen=True, slots=True)
class Acknowledge:
    """A camera's answer.

    Attributes:
        request_id: of the command.
        status: `ActionStatus`, or another one.
    """

    request_id: int
    status: int


def encode_action(keys: ActionKeys, request_id: int, time: DeviceNs | None = None) -> bytes:
    """An action command that wants an acknowledge.

    Args:
        keys: of the cameras that are meant.
        request_id: number that the acknowledge repeats, 1 to `LAST_REQUEST_ID`.
        time: when the cameras are to act, by their clocks, which PTP has locked; None: at once.
    """
    payload = _KEYS.pack(keys.device, keys.group, keys.mask) + (b"" if time is None else _TIME.pack(time))
    flags = _WANTS_ACK if time is None else _WANTS_ACK | _SCHEDULED
    return _HEADER.pack(_KEY, flags, _COMMAND, len(payload), request_id) + payload


def decode_acknowledge(datagram: bytes) -> Acknowledge | None:
    """The acknowledge of an action command; None: the datagram is something else."""
    if len(datagram) < _ACK.size:
        return None
    status, command, length, request_id = _ACK.unpack_from(datagram)
    if command != _ACKNOWLEDGE or length != len(datagram) - _ACK.size:
        return None
    return Acknowledge(request_id, status)
