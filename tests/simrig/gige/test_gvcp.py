"""The parser of control packets, fed with good, broken and random bytes."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from simrig.gige.protocol.gvcp import (
    MAX_MEMORY_BYTES,
    Action,
    Command,
    Discovery,
    NotGvcpError,
    PacketResend,
    ReadMemory,
    ReadRegisters,
    RefusedError,
    Request,
    Status,
    WriteMemory,
    WriteRegisters,
    acknowledge,
    parse,
    pending,
)


def command(number: int, payload: bytes = b"", flags: int = 1, request_id: int = 7) -> bytes:
    return struct.pack(">BBHHH", 0x42, flags, number, len(payload), request_id) + payload


@pytest.mark.parametrize(
    ("datagram", "body"),
    [
        (command(Command.DISCOVERY), Discovery()),
        (command(Command.READREG, struct.pack(">III", 0, 4, 0xA00)), ReadRegisters((0, 4, 0xA00))),
        (command(Command.WRITEREG, struct.pack(">IIII", 1, 2, 3, 4)), WriteRegisters(((1, 2), (3, 4)))),
        (command(Command.READMEM, struct.pack(">IHH", 0x200, 0, 512)), ReadMemory(0x200, 512)),
        (command(Command.WRITEMEM, struct.pack(">Id", 0x10000, 1.5)), WriteMemory(0x10000, struct.pack(">d", 1.5))),
        (command(Command.PACKETRESEND, struct.pack(">HHII", 0, 9, 3, 5)), PacketResend(9, 3, 5)),
        (
            command(Command.PACKETRESEND, struct.pack(">HHIIQ", 0, 0, 3, 5, 1 << 40), flags=0x10),
            PacketResend(1 << 40, 3, 5),
        ),
        (command(Command.ACTION, struct.pack(">III", 1, 2, 3)), Action(1, 2, 3, None)),
        (command(Command.ACTION, struct.pack(">IIIQ", 1, 2, 3, 99), flags=0x81), Action(1, 2, 3, 99)),
    ],
)
def test_commands_are_read(datagram: bytes, body: object) -> None:
    request = parse(datagram)
    assert request.body == body
    assert request.request_id == 7
    assert request.wants_ack == bool(datagram[1] & 1)


@pytest.mark.parametrize(
    ("datagram", "status"),
    [
        (command(0x0999), Status.NOT_IMPLEMENTED),
        (command(Command.PENDING), Status.NOT_IMPLEMENTED),
        (command(Command.READREG), Status.INVALID_PARAMETER),
        (command(Command.READREG, b"abc"), Status.INVALID_PARAMETER),
        (command(Command.WRITEREG, bytes(12)), Status.INVALID_PARAMETER),
        (command(Command.READMEM, struct.pack(">IHH", 0, 0, 0)), Status.INVALID_PARAMETER),
        (command(Command.READMEM, struct.pack(">IHH", 0, 0, MAX_MEMORY_BYTES + 4)), Status.INVALID_PARAMETER),
        (command(Command.WRITEMEM, bytes(4)), Status.INVALID_PARAMETER),
        (command(Command.PACKETRESEND, bytes(20)), Status.INVALID_PARAMETER),
        (command(Command.ACTION, bytes(12), flags=0x81), Status.INVALID_PARAMETER),
        (command(Command.DISCOVERY) + b"more", Status.INVALID_HEADER),
        (command(Command.DISCOVERY, request_id=0), Status.INVALID_HEADER),
    ],
)
def test_malformed_commands_are_refused_with_a_status(datagram: bytes, status: Status) -> None:
    with pytest.raises(RefusedError) as refused:
        parse(datagram)
    assert refused.value.status is status


@pytest.mark.parametrize(
    "datagram", [b"", b"B", b"\x42\x01\x00\x02\x00\x00\x00", b"\x00" * 8, b"GET / HTTP/1.1\r\n\r\n"]
)
def test_other_datagrams_are_not_answered(datagram: bytes) -> None:
    with pytest.raises(NotGvcpError):
        parse(datagram)


random_commands = st.builds(
    command, st.sampled_from(Command) | st.integers(0, 0xFFFF), st.binary(max_size=64), st.integers(0, 255)
)


@given(st.binary(max_size=600) | random_commands)
def test_no_bytes_whatever_harm_the_parser(datagram: bytes) -> None:
    whole = len(datagram) >= 8 and datagram[0] == 0x42
    try:
        outcome: object = parse(datagram)
    except (NotGvcpError, RefusedError) as error:
        outcome = error
    assert isinstance(outcome, Request | RefusedError if whole else NotGvcpError)


def test_acknowledge() -> None:
    assert acknowledge(Command.READREG, 7, b"abcd") == b"\x00\x00\x00\x81\x00\x04\x00\x07abcd"
    assert acknowledge(Command.WRITEREG, 7, b"", Status.ACCESS_DENIED) == b"\x80\x06\x00\x83\x00\x00\x00\x07"
    assert pending(7, 30) == b"\x00\x00\x00\x89\x00\x04\x00\x07\x00\x00\x00\x1e"
