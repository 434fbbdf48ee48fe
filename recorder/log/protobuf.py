"""Numbers and fields of serialized protobuf messages, for those whose large field must not be copied."""

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a message; positions are in bytes of the message.

    Attributes:
        key: number and wire type, as they stand there.
        begin: where the field begins.
        content: where what it holds begins.
        end: one past its last byte; behind the end of a message that is cut off.
    """

    key: int
    begin: int
    content: int
    end: int


def fields(message: memoryview) -> Iterator[Field]:
    """The fields of a message, in their order.

    Raises:
        ValueError: the bytes are no message.
    """
    position = 0
    while position < len(message):
        begin = position
        key, position = _number(message, position)
        if key < 8:
            raise ValueError("no protobuf message: a field has no number")
        length, position = _length(message, position, key & 7)
        yield Field(key, begin, position, position + length)
        position += length


def varint(number: int, least: int = 1) -> bytes:
    """Protobuf's variable-length integer: seven bits per byte, lowest first, in at least `least` bytes."""
    out = bytearray()
    while number > 0x7F or len(out) < least - 1:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)


def _length(message: memoryview, position: int, wire_type: int) -> tuple[int, int]:
    """Length of a field's content, and the position where the content starts."""
    match wire_type:
        case 0:
            return _number(message, position)[1] - position, position
        case 1:
            return 8, position
        case 2:
            return _number(message, position)
        case 5:
            return 4, position
        case _:
            raise ValueError(f"no protobuf message: unknown wire type {wire_type}")


def _number(message: memoryview, position: int) -> tuple[int, int]:
    """The variable-length integer at `position`, and the position after it."""
    number = 0
    for place in range(10):
        if position + place >= len(message):
            break
        byte = message[position + place]
        number |= (byte & 0x7F) << 7 * place
        if byte < 0x80:
            return number, position + place + 1
    raise ValueError("no protobuf message: it ends in the middle of a number")
