"""Lays out the bytes of a log: what stands around the pixels of a triplet, and small chunks.

A triplet is one chunk: its tag first, then its image. So a pulse is in the file whole or not at all, and a reader finds
tags without reading pixels. Padding records (private opcode 0x80, which every reader skips) stand before and after each
chunk, so that the pixels start and the write ends on a page boundary, as direct I/O demands.

    | padding | chunk: [tag message][image message: prefix | pixels ... ] | message indexes | padding |
              ^ somewhere in the first page(s)              ^ page boundary                          ^ page boundary

On request each camera has an image message of its own instead; they stand one after the other in the same chunk.
"""

import mmap
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import count, repeat

from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from isal.isal_zlib import crc32
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import McapRecord

from recorder.log.crc import combined_crc
from recorder.log.protobuf import varint
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import BadInputError
from rig.images.pixels import MONO8, Pixels
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
JUMPER_CHANNEL = 5
JUMPER_SCENE_CHANNEL = 6
JUMPER_CAMERAS_CHANNEL = 7
FIRST_CALIBRATION_CHANNEL = 16
FIRST_CAMERA_CHANNEL = 64

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
    return chunk_of(log_time, [(channel, message_head(channel, sequence, len(data), publish_time, log_time) + data)])


def chunk_of(log_time: UtcNs, messages: Sequence[tuple[int, bytes]]) -> tuple[bytes, ChunkPlan]:
    """The bytes of a chunk, and of its indexes, without padding.

    Args:
        log_time: of all messages, UTC.
        messages: channel and record of each; a channel has one message at most.
    """
    content = b"".join(record for _, record in messages)
    chunk = _chunk_head(log_time, len(content), crc32(content)) + content
    whole, indexes, offset = bytearray(chunk), [], 0
    for channel, record in messages:
        indexes.append((channel, len(whole)))
        whole += _index(channel, log_time, offset)
        offset += len(record)
    return bytes(whole), ChunkPlan(
        0, len(chunk), len(content), log_time, tuple(indexes), len(whole) - len(chunk), len(whole), crc32(whole)
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class SlotImage:
    """An image message in a slot.

    Attributes:
        frame: name of what it shows: "triplet", or a camera.
        channel: of the message.
        columns: first column in the triplet, and one past the last.
        start: offset of its first pixel in the slot.
        end: offset of one past its last pixel.
    """

    frame: str
    channel: int
    columns: tuple[int, int]
    start: int
    end: int


class SlotLayout:
    """Where pixels and log records stand in a slot; completes a slot whose pixels are in place.

    Attributes:
        shape: rows and columns of the triplet.
        kind: how it holds its pixels.
        images: the image messages: one of the triplet or, on request, one of each camera.
        pixels: offset of the first pixel in the slot.
        end: offset of one past the last pixel.
        slot_bytes: size of a slot.
        most_tag_bytes: longest tag that has room before the pixels.
    """

    def __init__(
        self, shape: tuple[int, int], cameras: Sequence[tuple[str, tuple[int, int]]] = (), kind: Pixels = MONO8
    ):
        """Lay out a slot.

        Args:
            shape: rows and columns of the triplet.
            cameras: name and columns of each camera, if each gets an image message of its own.
            kind: how the triplet holds its pixels.

        Raises:
            BadInputError: the triplet is larger than a chunk may be.
        """
        column_bytes = shape[0] * kind.size
        if HEAD_ROOM + shape[1] * column_bytes > CHUNK_MAX:
            raise BadInputError(
                f"a triplet of {shape[1]} x {shape[0]} px: a log takes {CHUNK_MAX >> 20} MB per pulse at most; "
                "make the cameras' regions smaller"
            )
        self.shape, self.kind = shape, kind
        self.pixels = start = HEAD_ROOM
        images = []
        for place, (name, (begin, end)) in enumerate(cameras or [("triplet", (0, shape[1]))]):
            channel = FIRST_CAMERA_CHANNEL + place if cameras else TRIPLET_CHANNEL
            start += len(self._image_head(channel, name, end - begin, PulseNumber(1), UtcNs(0), UtcNs(0))) * (place > 0)
            images.append(SlotImage(name, channel, (begin, end), start, start + column_bytes * (end - begin)))
            start = images[-1].end
        self.images = tuple(images)
        self.end = start
        self.slot_bytes = round_up(self.end + (1 + len(images)) * _INDEX_OF_ONE.size + RECORD.size)
        combined_crc(0, 0, (1 << self.slot_bytes.bit_length()) - 1)  # makes its tables now, not with the first triplet
        first = images[0]
        width, latest = first.columns[1] - first.columns[0], UtcNs(_LATEST_NS)
        head = self._image_head(first.channel, first.frame, width, PulseNumber(1), latest, latest)
        self.most_tag_bytes = HEAD_ROOM - RECORD.size - _CHUNK.size - MESSAGE.size - len(head)

    def complete(
        self, slot: memoryview, tag: bytes, pulse: PulseNumber, pulse_time: UtcNs, log_time: UtcNs
    ) -> tuple[memoryview, ChunkPlan]:
        """Write everything around the pixels.

        Args:
            slot: the slot's bytes, the pixels in place.
            tag: the encoded tag.
            pulse: sequence of all messages.
            pulse_time: publish time of all messages.
            log_time: log time of all messages.

        Returns:
            The part of the slot to be written (whole pages) and where the chunk stands in it.

        Raises:
            ValueError: the tag does not fit before the pixels.
        """
        tag_message = message_head(TAG_CHANNEL, pulse, len(tag), pulse_time, log_time) + tag
        before = tag_message
        positions = []  # of the image messages in the slot
        for image in self.images:
            columns = image.columns[1] - image.columns[0]
            message = self._image_head(image.channel, image.frame, columns, pulse, pulse_time, log_time)
            positions.append(image.start - len(message))
            if image.start == self.pixels:
                before += message
            else:
                slot[positions[-1] : image.start] = message
        pixels = self.end - self.pixels
        size = len(before) + pixels
        content_crc = crc32(slot[self.pixels : self.end], crc32(before))
        head = _chunk_head(log_time, size, content_crc) + before
        start = self.pixels - round_up(len(head) + RECORD.size)
        if start < 0:
            raise ValueError(f"tag of {len(tag)} bytes does not fit before the pixels; shorten session and recording")
        chunk = self.pixels - len(head)
        lead = padding(chunk - start)
        slot[start : self.pixels] = lead + head
        offsets = (0, *(position - (self.pixels - len(before)) for position in positions))
        channels = (TAG_CHANNEL, *(image.channel for image in self.images))
        tail = b"".join(map(_index, channels, repeat(log_time), offsets))
        slot[self.end : self.slot_bytes] = rest = tail + padding(self.slot_bytes - self.end - len(tail))
        crc = combined_crc(crc32(head[: -len(before)], crc32(lead)), content_crc, size)  # the pixels are read once
        indexes = zip(channels, count(self.end - start, _INDEX_OF_ONE.size), strict=False)
        return slot[start : self.slot_bytes], ChunkPlan(
            chunk - start, len(head) + pixels, size, log_time, tuple(indexes), len(tail),
            self.slot_bytes - start, crc32(rest, crc),
        )  # fmt: skip

    def _image_head(
        self, channel: int, frame: str, columns: int, pulse: PulseNumber, pulse_time: UtcNs, log_time: UtcNs
    ) -> bytes:
        """What stands before the pixels of an image message; of a camera's image it is always as long."""
        shape = (self.shape[0], columns)
        own = channel != TRIPLET_CHANNEL
        kind = self.kind
        if own:
            prefix = camera_image_prefix(shape, pulse_time, frame, kind)
        else:
            prefix = raw_image_prefix(shape, pulse_time, kind)
        data_bytes = len(prefix) + shape[0] * columns * self.kind.size
        return message_head(channel, pulse, data_bytes, pulse_time, log_time) + prefix


def raw_image_prefix(shape: tuple[int, int], time: UtcNs, kind: Pixels = MONO8) -> bytes:
    """A serialized `foxglove.RawImage` up to the pixels, which come last, rows without gaps."""
    image = _raw_image(shape, "triplet", kind)
    image.timestamp.FromNanoseconds(time)
    head: bytes = image.SerializeToString()
    return head + pixels_field(shape, kind)


def camera_image_prefix(shape: tuple[int, int], time: UtcNs, frame: str, kind: Pixels = MONO8) -> bytes:
    """The same for the image of a camera; as long whatever the time, because other pixels stand right before it.

    The numbers of the time stamp are filled up with zero bits, which protobuf allows.
    """
    seconds, nanoseconds = divmod(time, NS_PER_S)
    stamp = b"".join(bytes([field << 3]) + varint(number, 5) for field, number in ((1, seconds), (2, nanoseconds)))
    timestamp = bytes([RawImage.TIMESTAMP_FIELD_NUMBER << 3 | 2, len(stamp)]) + stamp
    head: bytes = _raw_image(shape, frame, kind).SerializeToString()
    return timestamp + head + pixels_field(shape, kind)


def _raw_image(shape: tuple[int, int], frame: str, kind: Pixels) -> RawImage:
    step = shape[1] * kind.size
    return RawImage(frame_id=frame, width=shape[1], height=shape[0], encoding=kind.encoding, step=step)


def pixels_field(shape: tuple[int, int], kind: Pixels) -> bytes:
    """What stands in a serialized `foxglove.RawImage` right before the pixels: number and length of their field."""
    length = shape[0] * shape[1] * kind.size
    return bytes([RawImage.DATA_FIELD_NUMBER << 3 | 2]) + varint(length)  # type 2: length, then bytes


def join_pages(parts: Iterable[bytes]) -> mmap.mmap:
    """The parts one after the other, padded to whole pages, in page-aligned memory."""
    joined = b"".join(parts)
    size = round_up(len(joined) + RECORD.size)
    pages = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    pages[:] = joined + padding(size - len(joined))
    return pages


def _chunk_head(log_time: UtcNs, size: int, crc: int) -> bytes:
    return _CHUNK.pack(Opcode.CHUNK, _CHUNK.size - RECORD.size + size, log_time, log_time, size, crc, 0, size)


def message_head(channel: int, sequence: int, data_bytes: int, publish_time: UtcNs, log_time: UtcNs) -> bytes:
    """What stands in a message record before its data."""
    length = MESSAGE.size - RECORD.size + data_bytes
    return MESSAGE.pack(Opcode.MESSAGE, length, channel, sequence, log_time, publish_time)


def _index(channel: int, log_time: UtcNs, offset: int) -> bytes:
    return _INDEX_OF_ONE.pack(Opcode.MESSAGE_INDEX, _INDEX_OF_ONE.size - RECORD.size, channel, 16, log_time, offset)
