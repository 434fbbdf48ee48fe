"""Lays out the bytes of a log: what stands around the pixels of a triplet, and small chunks.

A triplet is one chunk: its tag first, then its image. So a pulse is in the file whole or not at all, and a reader finds
tags without reading pixels. Padding records (private opcode 0x80, which every reader skips) stand before and after each
chunk, so that the pixels start and the write ends on a page boundary, as direct I/O demands.

    | padding | chunk: [tag message][image message: prefix | pixels ... ] | message indexes | padding |
              ^ somewhere in the first page(s)              ^ page boundary                          ^ page boundary
"""

import mmap
import struct
from collections.abc import Iterable
from dataclasses import dataclass

from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from isal.isal_zlib import crc32
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import McapRecord

from recorder.log.crc import combined_crc
from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.pulse import PulseNumber

MAGIC = b"\x89MCAP0\r\n"
PAGE = 4096
PADDING_OPCODE = 0x80
#: No chunk is longer: readers refuse what claims to be.
CHUNK_MAX = 256 << 20

TRIPLET_CHANNEL = 1
TAG_CHANNEL = 2
EVENTS_CHANNEL = 3
HEALTH_CHANNEL = 4
FIRST_CALIBRATION_CHANNEL = 16

#: Bytes before the pixels of a slot, for the head of the chunk; a tag of 8 cameras takes about 2.5 kB of them.
HEAD_ROOM = 2 * PAGE

_LATEST_NS = (1 << 63) - 1  # the time of which the text is longest

RECORD = struct.Struct("<BQ")  # opcode, length of what follows
#: opcode, length, start and end time, size and CRC of the records, no compression (0-byte name), size
_CHUNK = struct.Struct("<BQQQQIIQ")
MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time; then the data
_INDEX_OF_ONE = struct.Struct("<BQHIQQ")  # opcode, length, channel, 16, log time, offset in the chunk's records


@dataclass(frozen=True, slots=True)
class ChunkPlan:
    """What the summary says about a chunk; offsets count from the first byte of the write.

    Attributes:
        offset: where the chunk record starts.
        length: bytes of the chunk record.
        size: bytes of the records in it.
        log_time: log time of all its messages, UTC.
        indexes: for each channel with a message in the chunk, its id and where its message index record starts.
        indexes_length: bytes of the message index records, which follow the chunk.
        written: bytes of the write.
        crc: CRC-32 of these bytes.
    """

    offset: int
    length: int
    size: int
    log_time: UtcNs
    indexes: tuple[tuple[int, int], ...]
    indexes_length: int
    written: int
    crc: int


def round_up(size: int, unit: int = PAGE) -> int:
    """The next multiple of `unit` that is at least `size`."""
    return -(-size // unit) * unit


def padding(size: int) -> bytes:
    """A padding record of `size` bytes, at least 9."""
    return RECORD.pack(PADDING_OPCODE, size - RECORD.size) + bytes(size - RECORD.size)


def records(*them: McapRecord) -> bytes:
    """The bytes of records of the `mcap` library, one after the other."""
    builder = RecordBuilder()
    for record in them:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def chunk_of_one(
    channel: int, sequence: int, data: bytes, publish_time: UtcNs, log_time: UtcNs
) -> tuple[bytes, ChunkPlan]:
    """The bytes of a chunk with one message, and of its index, without padding."""
    head = _message_head(channel, sequence, len(data), publish_time, log_time)
    size = len(head) + len(data)
    chunk = _chunk_head(log_time, size, crc32(data, crc32(head))) + head + data
    index = _index(channel, log_time, 0)
    whole = chunk + index
    return whole, ChunkPlan(
        0, len(chunk), size, log_time, ((channel, len(chunk)),), len(index), len(whole), crc32(whole)
    )  # fmt: skip


class SlotLayout:
    """Where pixels and log records stand in a slot; completes a slot whose pixels are in place.

    Attributes:
        pixels: offset of the first pixel in the slot.
        end: offset of one past the last pixel.
        slot_bytes: size of a slot.
        most_tag_bytes: longest tag that has room before the pixels.
    """

    def __init__(self, shape: tuple[int, int]):
        """Lay out a slot.

        Raises:
            BadInputError: the triplet is larger than a chunk may be.
        """
        if HEAD_ROOM + shape[0] * shape[1] > CHUNK_MAX:
            raise BadInputError(
                f"a triplet of {shape[1]} x {shape[0]} px: a log takes {CHUNK_MAX >> 20} MB per pulse at most; "
                "make the cameras' regions smaller"
            )
        self.shape = shape
        self.pixels = HEAD_ROOM
        self.end = HEAD_ROOM + shape[0] * shape[1]
        self.slot_bytes = round_up(self.end + 2 * _INDEX_OF_ONE.size + RECORD.size)
        combined_crc(0, 0, (1 << self.slot_bytes.bit_length()) - 1)  # makes its tables now, not with the first triplet
        prefix = len(raw_image_prefix(shape, UtcNs(_LATEST_NS)))
        self.most_tag_bytes = HEAD_ROOM - RECORD.size - _CHUNK.size - 2 * MESSAGE.size - prefix

    def complete(
        self, slot: memoryview, tag: bytes, pulse: PulseNumber, pulse_time: UtcNs, log_time: UtcNs
    ) -> tuple[memoryview, ChunkPlan]:
        """Write everything around the pixels.

        Args:
            slot: the slot's bytes, the pixels in place.
            tag: the encoded tag.
            pulse: sequence of both messages.
            pulse_time: publish time of both messages.
            log_time: log time of both messages.

        Returns:
            The part of the slot to be written (whole pages) and where the chunk stands in it.

        Raises:
            ValueError: the tag does not fit before the pixels.
        """
        tag_message = _message_head(TAG_CHANNEL, pulse, len(tag), pulse_time, log_time) + tag
        prefix = raw_image_prefix(self.shape, pulse_time)
        pixels = self.end - self.pixels
        before = tag_message + _message_head(
            TRIPLET_CHANNEL, pulse, len(prefix) + pixels, pulse_time, log_time
        ) + prefix  # fmt: skip
        size = len(before) + pixels
        content_crc = crc32(slot[self.pixels : self.end], crc32(before))
        head = _chunk_head(log_time, size, content_crc) + before
        start = self.pixels - round_up(len(head) + RECORD.size)
        if start < 0:
            raise ValueError(f"tag of {len(tag)} bytes does not fit before the pixels; shorten session and recording")
        chunk = self.pixels - len(head)
        lead = padding(chunk - start)
        slot[start : self.pixels] = lead + head
        tail = _index(TAG_CHANNEL, log_time, 0) + _index(TRIPLET_CHANNEL, log_time, len(tag_message))
        slot[self.end : self.slot_bytes] = rest = tail + padding(self.slot_bytes - self.end - len(tail))
        tag_index = self.end - start
        crc = combined_crc(crc32(head[: -len(before)], crc32(lead)), content_crc, size)  # the pixels are read once
        return slot[start : self.slot_bytes], ChunkPlan(
            chunk - start, len(head) + pixels, size, log_time,
            ((TAG_CHANNEL, tag_index), (TRIPLET_CHANNEL, tag_index + _INDEX_OF_ONE.size)), len(tail),
            self.slot_bytes - start, crc32(rest, crc),
        )  # fmt: skip


def raw_image_prefix(shape: tuple[int, int], time: UtcNs) -> bytes:
    """A serialized `foxglove.RawImage` up to the pixels, which come last: mono8, rows without gaps."""
    rows, columns = shape
    image = RawImage(frame_id="triplet", width=columns, height=rows, encoding="mono8", step=columns)
    image.timestamp.FromNanoseconds(time)
    data_field = RawImage.DATA_FIELD_NUMBER << 3 | 2  # wire type 2: length, then bytes
    head: bytes = image.SerializeToString()
    return head + bytes([data_field]) + _varint(rows * columns)


def join_pages(parts: Iterable[bytes]) -> mmap.mmap:
    """The parts one after the other, padded to whole pages, in page-aligned memory."""
    joined = b"".join(parts)
    size = round_up(len(joined) + RECORD.size)
    pages = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    pages[:] = joined + padding(size - len(joined))
    return pages


def _chunk_head(log_time: UtcNs, size: int, crc: int) -> bytes:
    return _CHUNK.pack(Opcode.CHUNK, _CHUNK.size - RECORD.size + size, log_time, log_time, size, crc, 0, size)


def _message_head(channel: int, sequence: int, data_bytes: int, publish_time: UtcNs, log_time: UtcNs) -> bytes:
    length = MESSAGE.size - RECORD.size + data_bytes
    return MESSAGE.pack(Opcode.MESSAGE, length, channel, sequence, log_time, publish_time)


def _index(channel: int, log_time: UtcNs, offset: int) -> bytes:
    return _INDEX_OF_ONE.pack(Opcode.MESSAGE_INDEX, _INDEX_OF_ONE.size - RECORD.size, channel, 16, log_time, offset)


def _varint(number: int) -> bytes:
    """Protobuf's variable-length integer: seven bits per byte, lowest first."""
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    out.append(number)
    return bytes(out)
