"""Finds the tags of pulses in damaged bytes of a log.

A tag is small beside its image, so what damages a chunk seldom damages its tag. A tag that is found in damaged bytes is
believed only if the head of its message gives the same pulse and time: then neither was hit.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from mcap.opcode import Opcode

from recorder.log.mcap_layout import MESSAGE, RECORD, TAG_CHANNEL
from recorder.reading.items import Message
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import decoded_tag
from rig.clocks import UtcNs
from rig.pulse import PulseNumber
from rig.tag import TripletTag

#: Damaged bytes are searched in pieces of this size for tags that begin like this and are at most so long.
_PIECE: Final = 4 << 20
_TAG_BEGINS: Final = b'{"pulse":'
_TAG_MAX: Final = 1 << 16


@dataclass(frozen=True, slots=True)
class FoundTag:
    """A tag that stands in the file from `offset` on, `length` bytes."""

    tag: TripletTag
    offset: int
    length: int


def tags_in(reader: LogReader, offset: int, length: int) -> Iterator[FoundTag]:
    """The tags that are whole in `length` bytes of a log from `offset` on."""
    overlap = MESSAGE.size + _TAG_MAX
    end = offset + length
    begin = offset
    while (begin := reader.data_from(begin)) < end:
        piece = bytes(reader.read(begin, min(_PIECE + overlap, end - begin)))
        place = piece.find(_TAG_BEGINS)
        while 0 <= place < _PIECE + MESSAGE.size:
            if place >= MESSAGE.size and (found := _tag_at(piece, place)) is not None:
                tag, tag_length = found
                yield FoundTag(tag, begin + place, tag_length)
            place = piece.find(_TAG_BEGINS, place + 1)
        begin += _PIECE


def pulse_of(messages: Sequence[Message]) -> tuple[PulseNumber, UtcNs] | None:
    """Number and time of a pulse whose tag is destroyed, if the heads of its two messages agree on both.

    Args:
        messages: the messages of a chunk, as far as they could be read.
    """
    for one, other in pairwise(messages):
        if (one.sequence, one.publish_time) == (other.sequence, other.publish_time) and one.channel == TAG_CHANNEL:
            return PulseNumber(one.sequence), one.publish_time
    return None


def _tag_at(piece: bytes, place: int) -> tuple[TripletTag, int] | None:
    """The tag at `place` and its length, None if it is not whole or does not fit the head of the message before it."""
    opcode, length, channel, sequence, _, publish_time = MESSAGE.unpack_from(piece, place - MESSAGE.size)
    end = place - MESSAGE.size + RECORD.size + length
    if opcode != Opcode.MESSAGE or channel != TAG_CHANNEL or not place < end <= min(len(piece), place + _TAG_MAX):
        return None
    tag = decoded_tag(piece[place:end])
    return None if tag is None or (tag.pulse, tag.time) != (sequence, publish_time) else (tag, end - place)
