"""Bits of a quadlet as IEEE 1394 and IIDC count them: bit 0 is the highest."""


def bit(number: int) -> int:
    """A quadlet with this bit set."""
    return 1 << (31 - number)


def field(value: int, first: int, last: int) -> int:
    """Bits `first` to `last` of a quadlet."""
    return value >> (31 - last) & ((1 << (last - first + 1)) - 1)


def with_field(value: int, first: int, last: int, content: int) -> int:
    """The quadlet with bits `first` to `last` replaced."""
    mask = ((1 << (last - first + 1)) - 1) << (31 - last)
    return value & ~mask | (content << (31 - last) & mask)
