"""A bare GVCP client, for what Aravis does not do: foreign controllers, actions, broken datagrams."""

import socket
import struct
from dataclasses import dataclass
from itertools import count
from typing import Self

from simrig.gige.protocol.gvcp import PORT, Command

CCP = 0x0A00
PENDING_ACK = Command.PENDING + 1


@dataclass(frozen=True, slots=True)
class Ack:
    """An acknowledge."""

    status: int
    command: int
    request_id: int
    payload: bytes


class GvcpClient:
    """One socket that talks to one camera."""

    def __init__(self, address: str) -> None:
        self._address = address
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(2.0)
        self._ids = count(1)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.socket.close()

    def send(self, command: int, payload: bytes = b"", flags: int = 1, request_id: int | None = None) -> int:
        """Send a command; its request number."""
        number = next(self._ids) if request_id is None else request_id
        datagram = struct.pack(">BBHHH", 0x42, flags, command, len(payload), number) + payload
        self.socket.sendto(datagram, (self._address, PORT))
        return number

    def hear(self) -> Ack:
        """The next acknowledge."""
        data = self.socket.recv(2048)
        status, command, length, number = struct.unpack_from(">HHHH", data)
        assert len(data) == 8 + length
        return Ack(status, command, number, data[8:])

    def silent(self, timeout_s: float) -> bool:
        """Whether nothing comes for a while."""
        self.socket.settimeout(timeout_s)
        try:
            self.socket.recv(2048)
        except TimeoutError:
            return True
        finally:
            self.socket.settimeout(2.0)
        return False

    def ask(self, command: int, payload: bytes = b"", flags: int = 1) -> Ack:
        """Send a command and wait for its acknowledge."""
        number = self.send(command, payload, flags)
        ack = self.hear()
        assert ack.request_id == number
        return ack

    def write(self, address: int, value: int) -> int:
        """Write a register; the status."""
        return self.ask(Command.WRITEREG, struct.pack(">II", address, value)).status

    def read(self, address: int) -> int:
        """Read a register.

        Raises:
            AssertionError: the camera refused.
        """
        ack = self.ask(Command.READREG, struct.pack(">I", address))
        assert ack.status == 0, hex(ack.status)
        value: int = struct.unpack(">I", ack.payload)[0]
        return value
