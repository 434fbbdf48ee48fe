"""Asks a GigE Vision camera who it is and who controls it, without taking control of it.

Aravis takes control of every camera that it opens, which would disturb a recording; these two requests do not.
"""

import socket
import struct
import time
from dataclasses import dataclass

_PORT = 3956
_REQUEST = struct.Struct(">BBHHH")  # 0x42, flags, command, length, request id (GigE Vision 2.0, section 15)
_ANSWER = struct.Struct(">HHHH")  # status, acknowledge, length, request id
_KEY, _WANTS_ANSWER = 0x42, 0x01
_DISCOVERY, _READ_REGISTER = 0x0002, 0x0080
_CONTROL_CHANNEL_PRIVILEGE = 0x0A00
_CONTROLLED = 0b11  # exclusive access or control access is taken
_TRIES = 3


@dataclass(frozen=True, slots=True)
class GigeCamera:
    """What a camera says about itself."""

    vendor: str
    model: str
    serial: str
    in_use: bool


def ask_camera(address: str, timeout_s: float) -> GigeCamera | None:
    """Ask the camera at `address`; None if nobody answers in `timeout_s`.

    Raises:
        OSError: there is no way to the address.
        ValueError: somebody answers, but not as a camera does.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
        channel.connect((address, _PORT))
        who = _ask(channel, _DISCOVERY, b"", timeout_s)
        if who is None:
            return None
        if len(who) < 248:
            raise ValueError(f"the discovery answer has {len(who)} bytes, 248 are due")
        control = _ask(channel, _READ_REGISTER, struct.pack(">I", _CONTROL_CHANNEL_PRIVILEGE), timeout_s)
    in_use = control is not None and len(control) == 4 and bool(control[3] & _CONTROLLED)
    return GigeCamera(_text(who[72:104]), _text(who[104:136]), _text(who[216:232]), in_use)


def _ask(channel: socket.socket, command: int, payload: bytes, timeout_s: float) -> bytes | None:
    """The payload of the answer; the request is repeated, since a datagram may get lost."""
    for request_id in range(1, _TRIES + 1):
        channel.send(_REQUEST.pack(_KEY, _WANTS_ANSWER, command, len(payload), request_id) + payload)
        deadline = time.monotonic() + timeout_s / _TRIES
        while (left := deadline - time.monotonic()) > 0:
            channel.settimeout(left)
            try:
                answer = channel.recv(1024)
            except (TimeoutError, ConnectionRefusedError):  # refused: a machine is there, but no camera
                break
            if len(answer) >= _ANSWER.size and _ANSWER.unpack_from(answer)[1] == command + 1:
                return answer[_ANSWER.size :]
    return None


def _text(field: bytes) -> str:
    return field.split(b"\0")[0].decode(errors="replace")
