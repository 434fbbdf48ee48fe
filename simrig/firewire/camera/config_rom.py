"""The configuration ROM (IEEE 1212) by which a node says who it is and where its registers are."""

import struct
from typing import Final

HOST_VENDOR: Final = 0x001106  #: VIA, as on many controller cards
AVT: Final = 0x000A47
COMMAND_BASE: Final = 0xF00000  #: start of the IIDC registers, from the start of the initial register space

_BUS_NAME = 0x31333934  # "1394"
_CAPABILITIES = 0xF000A002  # isochronous, cycle master, bus manager; packets up to 2048 bytes
_NODE_CAPABILITIES = 0x0083C0
_IIDC = 0xA02D  # 1394 Trade Association
_IIDC_1_31 = (0x000102, 0x000010)  # unit software version and its subversion

# Keys of directory entries: the two highest bits say whether a value, a leaf or a directory follows.
_VENDOR, _CAPABILITY, _SPECIFIER, _VERSION = 0x03, 0x0C, 0x12, 0x13
_UNIT, _DEPENDENT, _COMMAND_REGISTERS, _SUBVERSION = 0xD1, 0xD4, 0x40, 0x38
_VENDOR_NAME, _MODEL_NAME = 0x81, 0x82


def host_rom(guid: int) -> tuple[int, ...]:
    """ROM of the computer itself, in quadlets."""
    root = [_VENDOR << 24 | HOST_VENDOR, _CAPABILITY << 24 | _NODE_CAPABILITIES]
    return (*_bus_info(guid), *_block(root))


def camera_rom(guid: int, vendor: str, model: str, vendor_id: int = AVT) -> tuple[int, ...]:
    """ROM of an IIDC 1.31 camera, in quadlets."""
    version, subversion = _IIDC_1_31
    leaves = _text(vendor), _text(model)
    # Offsets count from the entry itself. Root (3 entries), unit (3), dependent (4) and the leaves follow each other.
    root = [_VENDOR << 24 | vendor_id, _CAPABILITY << 24 | _NODE_CAPABILITIES, _UNIT << 24 | 1]
    unit = [_SPECIFIER << 24 | _IIDC, _VERSION << 24 | version, _DEPENDENT << 24 | 1]
    dependent = [
        _COMMAND_REGISTERS << 24 | COMMAND_BASE // 4,
        _SUBVERSION << 24 | subversion,
        _VENDOR_NAME << 24 | 2,
        _MODEL_NAME << 24 | 1 + len(leaves[0]),
    ]
    return (*_bus_info(guid), *_block(root), *_block(unit), *_block(dependent), *leaves[0], *leaves[1])


def crc16(quadlets: list[int]) -> int:
    """Check sum of a block (IEEE 1212, 7.3)."""
    crc = 0
    for quadlet in quadlets:
        for shift in range(28, -1, -4):
            total = (crc >> 12 ^ quadlet >> shift) & 0xF
            crc = (crc << 4 ^ total << 12 ^ total << 5 ^ total) & 0xFFFF
    return crc


def _bus_info(guid: int) -> list[int]:
    body = [_BUS_NAME, _CAPABILITIES, guid >> 32, guid & 0xFFFFFFFF]
    return [len(body) << 24 | len(body) << 16 | crc16(body), *body]


def _block(body: list[int]) -> list[int]:
    return [len(body) << 16 | crc16(body), *body]


def _text(text: str) -> list[int]:
    """A leaf with a text in ASCII."""
    data = text.encode("ascii")
    data += bytes(-len(data) % 4)
    return _block([0, 0, *struct.unpack(f">{len(data) // 4}I", data)])
