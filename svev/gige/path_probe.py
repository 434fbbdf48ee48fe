"""Asks a GigE Vision camera for test packets, to see how large ones come through all switches in between.

A camera that is told so sends one packet of zeros of the size of its stream channel, unfragmented (GigE Vision 2.0,
section 22.4). Aravis negotiates packet sizes in the same way.
"""

import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from svev.gige.gvcp import PORT, write_register

#: Registers of control privilege and of the first stream channel: its port, packet size and address (section 28).
_CONTROL, _STREAM_PORT, _PACKET_SIZE, _STREAM_ADDRESS = 0x0A00, 0x0D00, 0x0D04, 0x0D18
_CONTROL_ACCESS: Final = 0b10
_FIRE, _DO_NOT_FRAGMENT = 1 << 31, 1 << 30
_IP_UDP_BYTES: Final = 28
_PACKETS_TRIED: Final = 3
_ANSWER_S: Final = 0.5
#: A packet takes less than a millisecond.
_PACKET_S: Final = 0.2
#: What every network takes, and the largest packet of an Ethernet without jumbo frames.
SMALL: Final = 1400
_USUAL_BYTES: Final = 1500


class CameraRefusesError(Exception):
    """The camera does not do what it is told: another program controls it, or it does not answer any more."""


def largest_packet(address: str, wanted: int) -> int | None:
    """The largest packet that comes through from a camera: `wanted`, 1500 or 1400 bytes, IP header included.

    Takes control of the camera for that long.

    Returns:
        None: none comes, so that nothing is known: the camera sends no test packets, a firewall drops them, or another
        program controls the camera.

    Raises:
        OSError: there is no route to the camera.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as channel:
        channel.connect((address, PORT))
        try:
            with _controlled(channel), _receiver(channel) as receiver:
                if not _comes(channel, receiver, SMALL):
                    return None
                return next((size for size in (wanted, _USUAL_BYTES) if _comes(channel, receiver, size)), SMALL)
        except CameraRefusesError:
            return None


@contextmanager
def _controlled(channel: socket.socket) -> Iterator[None]:
    _write(channel, _CONTROL, _CONTROL_ACCESS)
    try:
        yield
    finally:
        _write(channel, _STREAM_PORT, 0)
        _write(channel, _CONTROL, 0)


@contextmanager
def _receiver(channel: socket.socket) -> Iterator[socket.socket]:
    """A socket to which the camera sends its test packets."""
    own = channel.getsockname()[0]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind((own, 0))
        _write(channel, _STREAM_ADDRESS, int.from_bytes(socket.inet_aton(own), "big"))
        _write(channel, _STREAM_PORT, receiver.getsockname()[1])
        yield receiver


def _comes(channel: socket.socket, receiver: socket.socket, size: int) -> bool:
    """Whether a test packet of so many bytes arrives; a single one may be lost by chance."""
    for _ in range(_PACKETS_TRIED):
        if not write_register(channel, _PACKET_SIZE, _FIRE | _DO_NOT_FRAGMENT | size, _ANSWER_S):
            return False  # the camera itself makes no packets of this size
        deadline = time.monotonic() + _PACKET_S
        while (left := deadline - time.monotonic()) > 0:
            receiver.settimeout(left)
            try:
                if len(receiver.recv(1 << 16)) == size - _IP_UDP_BYTES:
                    return True
            except TimeoutError:
                break
    return False


def _write(channel: socket.socket, register: int, value: int) -> None:
    """Write a register of the camera.

    Raises:
        CameraRefusesError: it refuses, or does not answer.
    """
    if not write_register(channel, register, value, _ANSWER_S):
        raise CameraRefusesError
