"""Wire format of the GigE Vision Control Protocol (GigE Vision 2.0, chapters 14 to 18): pure functions, no sockets.

Every field is big-endian. A command is `0x42, flags, command, length, request id` and `length` bytes of payload;
an acknowledge is `status, command + 1, length, request id` and its payload.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

PORT = 3956
MAX_DATAGRAM = 576  #: largest IP datagram that every GVCP party must accept
MAX_MEMORY_BYTES = 536  #: largest data of one READMEM or WRITEMEM in such a datagram

_KEY = 0x42
_HEADER = struct.Struct(">BBHHH")
_ACK = struct.Struct(">HHHH")
_FLAG_ACK = 0x01
_FLAG_EXTENDED_IDS = 0x10
_FLAG_SCHEDULED = 0x80


class Command(IntEnum):
    """Commands that the camera knows; the acknowledge of each has the next number."""

    DISCOVERY = 0x0002
    FORCEIP = 0x0004
    PACKETRESEND = 0x0040
    READREG = 0x0080
    WRITEREG = 0x0082
    READMEM = 0x0084
    WRITEMEM = 0x0086
    PENDING = 0x0088
    ACTION = 0x0100


class Status(IntEnum):
    """Status codes of acknowledges and of stream packets."""

    SUCCESS = 0x0000
    NOT_IMPLEMENTED = 0x8001
    INVALID_PARAMETER = 0x8002
    INVALID_ADDRESS = 0x8003
    WRITE_PROTECT = 0x8004
    BAD_ALIGNMENT = 0x8005
    ACCESS_DENIED = 0x8006
    PACKET_UNAVAILABLE = 0x800C
    DATA_OVERRUN = 0x800D
    INVALID_HEADER = 0x800E
    NO_REFERENCE_TIME = 0x8013
    OVERFLOW = 0x8015
    ACTION_LATE = 0x8016
    ERROR = 0x8FFF


@dataclass(frozen=True, slots=True)
class Discovery:
    """Ask every camera to identify itself."""


@dataclass(frozen=True, slots=True)
class ForceIp:
    """Give the camera with this MAC address another IPv4 address, until its power goes (section 14.2)."""

    mac: int
    address: int
    mask: int
    gateway: int


@dataclass(frozen=True, slots=True)
class ReadRegisters:
    """Read 32-bit registers."""

    addresses: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class WriteRegisters:
    """Write 32-bit registers in order until one refuses; pairs of address and value."""

    writes: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class ReadMemory:
    """Read `count` bytes."""

    address: int
    count: int


@dataclass(frozen=True, slots=True)
class WriteMemory:
    """Write bytes."""

    address: int
    data: bytes


@dataclass(frozen=True, slots=True)
class PacketResend:
    """Send the packets `first` to `last` (included) of a frame again."""

    block_id: int
    first: int
    last: int


@dataclass(frozen=True, slots=True)
class Action:
    """Trigger the action that the keys select, now or at `time` (ticks of the camera's clock)."""

    device_key: int
    group_key: int
    group_mask: int
    time: int | None


Body = Discovery | ForceIp | ReadRegisters | WriteRegisters | ReadMemory | WriteMemory | PacketResend | Action


@dataclass(frozen=True, slots=True)
class Request:
    """One parsed command.

    Attributes:
        wants_ack: whether the sender wants an answer.
        body: the command's content.
    """

    command: Command
    request_id: int
    wants_ack: bool
    body: Body


class NotGvcpError(Exception):
    """The datagram is no GVCP command; the camera does not answer it."""


class RefusedError(Exception):
    """A command that the camera answers with an error status.

    Attributes:
        status: why.
        command: number of the command.
        request_id: which request.
        wants_ack: whether the sender wants an answer.
    """

    def __init__(self, status: Status, command: int, request_id: int, wants_ack: bool) -> None:
        super().__init__(f"command {command:#06x}: {status.name}")
        self.status, self.command, self.request_id, self.wants_ack = status, command, request_id, wants_ack


def parse(datagram: bytes) -> Request:
    """Parse one datagram.

    Raises:
        NotGvcpError: not a GVCP command.
        RefusedError: a command, but malformed or unknown.
    """
    if len(datagram) < _HEADER.size or datagram[0] != _KEY:
        raise NotGvcpError
    _, flags, command, length, request_id = _HEADER.unpack_from(datagram)
    payload = datagram[_HEADER.size :]
    wants_ack = bool(flags & _FLAG_ACK)
    if request_id == 0 or len(payload) != length:
        raise RefusedError(Status.INVALID_HEADER, command, request_id, wants_ack)
    try:
        known = Command(command)
        body = _PARSERS[known](payload, flags)
    except (ValueError, KeyError):
        raise RefusedError(Status.NOT_IMPLEMENTED, command, request_id, wants_ack) from None
    except struct.error:
        raise RefusedError(Status.INVALID_PARAMETER, command, request_id, wants_ack) from None
    return Request(known, request_id, wants_ack, body)


def _discovery(payload: bytes, flags: int) -> Discovery:
    del payload, flags
    return Discovery()


def _force_ip(payload: bytes, flags: int) -> ForceIp:
    del flags
    mac_high, mac_low, address, mask, gateway = struct.unpack(">2xHI12xI12xI12xI", payload)
    return ForceIp(mac_high << 32 | mac_low, address, mask, gateway)


def _read_registers(payload: bytes, flags: int) -> ReadRegisters:
    del flags
    _require(payload, len(payload) > 0)
    return ReadRegisters(tuple(address for (address,) in struct.iter_unpack(">I", payload)))


def _write_registers(payload: bytes, flags: int) -> WriteRegisters:
    del flags
    _require(payload, len(payload) > 0)
    return WriteRegisters(tuple((address, value) for address, value in struct.iter_unpack(">II", payload)))


def _read_memory(payload: bytes, flags: int) -> ReadMemory:
    del flags
    address, count = struct.unpack(">IxxH", payload)
    _require(payload, 0 < count <= MAX_MEMORY_BYTES)
    return ReadMemory(address, count)


def _write_memory(payload: bytes, flags: int) -> WriteMemory:
    del flags
    (address,) = struct.unpack_from(">I", payload)
    _require(payload, 0 < len(payload) - 4 <= MAX_MEMORY_BYTES)
    return WriteMemory(address, payload[4:])


def _packet_resend(payload: bytes, flags: int) -> PacketResend:
    if flags & _FLAG_EXTENDED_IDS:
        first, last, block_id = struct.unpack(">xxxxIIQ", payload)
        return PacketResend(block_id, first, last)
    block_id, first, last = struct.unpack(">xxHII", payload)
    return PacketResend(block_id, first & 0xFFFFFF, last & 0xFFFFFF)


def _action(payload: bytes, flags: int) -> Action:
    if flags & _FLAG_SCHEDULED:
        return Action(*struct.unpack(">IIIQ", payload))
    device_key, group_key, group_mask = struct.unpack(">III", payload)
    return Action(device_key, group_key, group_mask, None)


def _require(payload: bytes, holds: bool) -> None:
    if not holds:
        raise struct.error(f"{len(payload)} bytes of payload do not fit the command")


_PARSERS: dict[Command, Callable[[bytes, int], Body]] = {
    Command.DISCOVERY: _discovery,
    Command.FORCEIP: _force_ip,
    Command.READREG: _read_registers,
    Command.WRITEREG: _write_registers,
    Command.READMEM: _read_memory,
    Command.WRITEMEM: _write_memory,
    Command.PACKETRESEND: _packet_resend,
    Command.ACTION: _action,
}


def acknowledge(command: int, request_id: int, payload: bytes = b"", status: Status = Status.SUCCESS) -> bytes:
    """The acknowledge of a command."""
    return _ACK.pack(status, command + 1, len(payload), request_id) + payload


def pending(request_id: int, wait_ms: int) -> bytes:
    """PENDING_ACK: the acknowledge of request `request_id` will follow within `wait_ms`."""
    return acknowledge(Command.PENDING, request_id, struct.pack(">HH", 0, wait_ms))


def registers_ack(request_id: int, values: list[int], status: Status) -> bytes:
    """READREG_ACK; with an error status it holds the values read before the failing one."""
    return acknowledge(Command.READREG, request_id, struct.pack(f">{len(values)}I", *values), status)


def written_ack(command: Command, request_id: int, index: int, status: Status) -> bytes:
    """WRITEREG_ACK or WRITEMEM_ACK; `index` is the number of registers or bytes written."""
    return acknowledge(command, request_id, struct.pack(">HH", 0, index), status)


def memory_ack(request_id: int, address: int, data: bytes) -> bytes:
    """READMEM_ACK."""
    return acknowledge(Command.READMEM, request_id, struct.pack(">I", address) + data)
