"""The kernel's GPIO interface, version 2, as far as the emulated chip takes part in it (`<linux/gpio.h>`)."""

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Final

from rig.clocks import HostNs
from simrig.world.cable import CONNECT

_TEXT: Final = 32
_CHIP_INFO: Final = struct.Struct(f"={_TEXT}s{_TEXT}sI")
_LINE_INFO: Final = struct.Struct(f"={_TEXT}s{_TEXT}sIIQ176x")
_REQUEST: Final = struct.Struct(f"=64I{_TEXT}sQI20x")
_ATTRIBUTE: Final = struct.Struct("=I4xQQ")
_ATTRIBUTES: Final = 10
_REQUEST_END: Final = struct.Struct("=II20xi")
_EVENT: Final = struct.Struct("=QIIII24x")
_EDGE: Final = struct.Struct("=QQQ")
_FLAGS, _VALUES, _DEBOUNCE = 1, 2, 3


class Ioctl(IntEnum):
    """The numbers of the ioctls of a chip; 0 is the shim's word that it was opened, 255 that a cable is plugged in."""

    OPENED = 0
    CHIP_INFO = 1
    LINE_INFO = 5
    REQUEST = 7
    CABLE = CONNECT


class LineFlag(IntFlag):
    """How a line is used."""

    USED = 1
    ACTIVE_LOW = 2
    INPUT = 4
    OUTPUT = 8
    RISING = 16
    FALLING = 32


@dataclass(frozen=True, slots=True)
class LineRequest:
    """Request of one line.

    Attributes:
        offset: number of the line.
        consumer: who wants it.
        flags: how it is to be used.
        active: an output is active at first.
        debounce_us: an input is steady for so long before its edge counts.
    """

    offset: int
    consumer: str
    flags: LineFlag
    active: bool
    debounce_us: int

    @classmethod
    def parsed(cls, data: bytes) -> "LineRequest | None":
        """From its bytes; None: it is none for a single line."""
        end = _REQUEST.size + _ATTRIBUTES * _ATTRIBUTE.size
        if len(data) != end + _REQUEST_END.size or _REQUEST_END.unpack_from(data, end)[0] != 1:
            return None
        *offsets, consumer, flags, count = _REQUEST.unpack_from(data)
        found = {_FLAGS: flags, _VALUES: 0, _DEBOUNCE: 0}
        for index in range(count):
            kind, value, mask = _ATTRIBUTE.unpack_from(data, _REQUEST.size + index * _ATTRIBUTE.size)
            if mask & 1:
                found[kind] = value & 0xFFFFFFFF if kind == _DEBOUNCE else value
        name = consumer.rstrip(b"\0").decode()
        return cls(offsets[0], name, LineFlag(found[_FLAGS]), bool(found[_VALUES] & 1), found[_DEBOUNCE])


def chip_info(name: str, label: str, lines: int) -> bytes:
    """Answer to CHIP_INFO."""
    return _CHIP_INFO.pack(name.encode(), label.encode(), lines)


def line_info(name: str, consumer: str, offset: int, flags: LineFlag) -> bytes:
    """Answer to LINE_INFO."""
    return _LINE_INFO.pack(name.encode(), consumer.encode(), offset, 0, flags)


def asked_line(data: bytes) -> int | None:
    """Number of the line that LINE_INFO asks for; None: the request is broken."""
    if len(data) != _LINE_INFO.size:
        return None
    offset: int = _LINE_INFO.unpack(data)[2]
    return offset


def edge_event(time: HostNs, *, rising: bool, offset: int, number: int) -> bytes:
    """What a program reads of an edge at an input."""
    return _EVENT.pack(time, 1 if rising else 2, offset, number, number)


def set_value(data: bytes) -> tuple[HostNs, bool] | None:
    """When a program set its line, and whether to active; None: it set nothing."""
    if len(data) != _EDGE.size:
        return None
    time, bits, mask = _EDGE.unpack(data)
    return (HostNs(time), bool(bits & 1)) if mask & 1 else None
