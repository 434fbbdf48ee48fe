"""Checks the structure of a log: message indexes against chunks, summary and footer against what was read."""

from collections import Counter
from collections.abc import Callable
from hashlib import blake2b
from typing import Any

from isal.isal_zlib import crc32
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Statistics,
    SummaryOffset,
)

from recorder.log.index import FOOTER_BEFORE_CRC, attachment_index
from recorder.log.mcap_layout import RECORD, records
from recorder.reading.items import Chunk, Item, SmallRecord
from recorder.reading.log_reader import UNREADABLE, LogReader, stream
from recorder.reading.records import Damage

_PIECE = 1 << 20

#: Records that the summary should repeat or list: their name in findings, and how to read them for comparison (None:
#: compare digests of their bytes).
_LISTED: dict[int, tuple[str, Callable[[Any], McapRecord] | None]] = {
    Opcode.SCHEMA: ("schemas", None),
    Opcode.CHANNEL: ("channels", None),
    Opcode.CHUNK_INDEX: ("chunk indexes", ChunkIndex.read),
    Opcode.ATTACHMENT_INDEX: ("attachment indexes", AttachmentIndex.read),
    Opcode.METADATA_INDEX: ("metadata indexes", MetadataIndex.read),
}


class StructureCheck:
    """Checks item after item, all of the log in its order.

    The summary is compared only if everything before it could be read: otherwise it cannot fit, and the reason has
    been reported already. The check keeps about 100 bytes per chunk.

    Args:
        reader: the log that the items are from.
        report: called with each finding.

    Attributes:
        data_checksum: the log holds a checksum over every byte before its summary.
        summary_checksum: the log holds a checksum over its summary.
    """

    def __init__(self, reader: LogReader, report: Callable[[str], None]) -> None:
        self._reader = reader
        self._report = report
        self.data_checksum = self.summary_checksum = False
        self._sound = True
        self._chunk: _OpenChunk | None = None
        self._expected: dict[int, list[bytes]] = {opcode: [] for opcode in _LISTED}
        self._listed = Counter[int]()
        self._messages = Counter[int]()
        self._chunks = 0
        self._times: tuple[int, int] | None = None
        self._summary_start: int | None = None
        self._groups: dict[int, tuple[int, int]] = {}
        self._summary_offsets: dict[int, tuple[int, int]] = {}

    def take(self, item: Item) -> None:
        """Check one item."""
        if isinstance(item, SmallRecord) and item.opcode == Opcode.MESSAGE_INDEX:
            self._message_index(item)
            return
        self._end_chunk()
        match item:
            case Chunk():
                self._begin_chunk(item)
            case Damage():
                self._sound = False
            case SmallRecord() if self._summary_start is None:
                self._data_record(item)
            case SmallRecord():
                self._summary_record(item)

    def finish(self) -> None:
        """Report what is missing at the end of the file."""
        self._end_chunk()
        if self._summary_start is None and self._reader.closed:
            self._report("the log does not say where its data ends")
        if self._summary_start is None or not self._sound:
            return
        for opcode, (name, _) in _LISTED.items():
            if self._listed[opcode] < len(self._expected[opcode]):
                listed, there = self._listed[opcode], len(self._expected[opcode])
                self._report(f"the summary has {listed} of {there} {name}")
        if self._summary_offsets and self._summary_offsets != self._groups:
            self._report("the summary offsets do not say where the summary's records are")

    def _begin_chunk(self, chunk: Chunk) -> None:
        if self._summary_start is not None:
            self._report(f"chunk at byte {chunk.offset}: stands behind the end of the data")
        self._sound = self._sound and not chunk.flaw
        self._chunk = _OpenChunk(chunk)
        self._chunks += 1
        self._messages.update(message.channel for message in chunk.messages)
        for declaration in chunk.declarations:
            self._declare(declaration)
        times = [message.log_time for message in chunk.messages]
        if not times or chunk.flaw:
            return
        if (min(times), max(times)) != (chunk.start_time, chunk.end_time):
            self._report(f"chunk at byte {chunk.offset}: its times are not those of its messages")
        first, last = self._times or (min(times), max(times))
        self._times = min(first, *times), max(last, *times)

    def _message_index(self, item: SmallRecord) -> None:
        try:
            if self._chunk is None or not self._chunk.take(MessageIndex.read(stream(item.body)), item):
                self._report(f"message index at byte {item.offset}: does not fit the chunk before it")
        except UNREADABLE as error:
            self._report(f"message index at byte {item.offset}: cannot be read ({error})")

    def _end_chunk(self) -> None:
        chunk, self._chunk = self._chunk, None
        if chunk is None:
            return
        if chunk.unindexed:
            self._report(f"chunk at byte {chunk.offset}: has no message index for some of its messages")
        self._expected[Opcode.CHUNK_INDEX].append(_body(chunk.index()))

    def _declare(self, item: SmallRecord) -> None:
        """Expect a schema or channel in the summary: once, however often it is declared."""
        digest = _digest(item.body)
        if digest not in self._expected[item.opcode]:
            self._expected[item.opcode].append(digest)

    def _data_record(self, item: SmallRecord) -> None:
        match item.opcode:
            case Opcode.SCHEMA | Opcode.CHANNEL:
                self._declare(item)
            case Opcode.ATTACHMENT:
                index = attachment_index(Attachment.read(stream(item.body)), item.offset, item.length)
                self._expected[Opcode.ATTACHMENT_INDEX].append(_body(index))
            case Opcode.METADATA:
                name = Metadata.read(stream(item.body)).name
                self._expected[Opcode.METADATA_INDEX].append(_body(MetadataIndex(item.offset, item.length, name)))
            case Opcode.MESSAGE:
                self._report(f"message at byte {item.offset}: stands outside of a chunk")
            case Opcode.DATA_END:
                self._summary_start = item.offset + item.length
                self._data_end(DataEnd.read(stream(item.body)))

    def _data_end(self, data_end: DataEnd) -> None:
        self.data_checksum = bool(data_end.data_section_crc)
        if self.data_checksum and self._reader.data_crc not in (data_end.data_section_crc, None):
            self._report("the checksum of everything before the summary is wrong")

    def _summary_record(self, item: SmallRecord) -> None:
        start, length = self._groups.get(item.opcode, (item.offset, 0))
        try:
            match item.opcode:
                case Opcode.FOOTER:
                    self._footer(item, Footer.read(stream(item.body)))
                    return
                case Opcode.SUMMARY_OFFSET:
                    offset = SummaryOffset.read(stream(item.body))
                    if offset.group_length:  # some writers list groups that are empty
                        self._summary_offsets[int(offset.group_opcode)] = offset.group_start, offset.group_length
                    return
                case Opcode.STATISTICS:
                    self._statistics(Statistics.read(stream(item.body)))
                case _:
                    self._compare(item)
        except UNREADABLE as error:
            self._report(f"summary record at byte {item.offset}: cannot be read ({error})")
        self._groups[item.opcode] = start, length + item.length

    def _compare(self, item: SmallRecord) -> None:
        place, expected = self._listed[item.opcode], self._expected.get(item.opcode)
        self._listed[item.opcode] += 1
        if expected is None or not self._sound:
            return
        name, read = _LISTED[item.opcode]
        found = _digest(item.body) if read is None else item.body
        if place >= len(expected):
            self._report(f"the summary has more {name} than there is to list")
        elif found != expected[place] and (read is None or read(stream(found)) != read(stream(expected[place]))):
            self._report(f"the summary's {name}: number {place + 1} is not what the log holds")

    def _statistics(self, statistics: Statistics) -> None:
        first, last = self._times or (0, 0)
        counted = Statistics(
            attachment_count=len(self._expected[Opcode.ATTACHMENT_INDEX]),
            channel_count=len(self._expected[Opcode.CHANNEL]),
            channel_message_counts=dict(self._messages),
            chunk_count=self._chunks,
            message_count=self._messages.total(),
            message_end_time=last,
            message_start_time=first,
            metadata_count=len(self._expected[Opcode.METADATA_INDEX]),
            schema_count=len(self._expected[Opcode.SCHEMA]),
        )
        if self._sound and statistics != counted:
            self._report("the statistics in the summary are not those of the log")

    def _footer(self, item: SmallRecord, footer: Footer) -> None:
        start = self._summary_start or 0
        if footer.summary_start != start:
            self._report(f"the footer says that the summary starts at byte {footer.summary_start}, not {start}")
            return
        if footer.summary_crc:
            self.summary_checksum = True
            crc = 0
            for offset in range(start, item.offset, _PIECE):
                crc = crc32(self._reader.read(offset, min(_PIECE, item.offset - offset)), crc)
            covered = FOOTER_BEFORE_CRC.size
            if crc32(self._reader.read(item.offset, covered), crc) != footer.summary_crc:
                self._report("the checksum of the summary is wrong")


class _OpenChunk:
    """A chunk whose message indexes, which stand behind it, are being read."""

    def __init__(self, chunk: Chunk) -> None:
        self.offset = chunk.offset
        self._facts = chunk
        self._wanted: dict[int, list[tuple[int, int]]] = {}
        for message in () if chunk.flaw else chunk.messages:
            self._wanted.setdefault(message.channel, []).append((message.log_time, message.position))
        self._index_offsets: dict[int, int] = {}
        self._index_bytes = 0

    @property
    def unindexed(self) -> bool:
        """Whether messages are left that no index named."""
        return bool(self._wanted)

    def take(self, index: MessageIndex, item: SmallRecord) -> bool:
        """Compare one message index with the chunk's messages.

        Returns:
            Whether it fits; True if the chunk could not be read.
        """
        self._index_offsets[index.channel_id] = item.offset
        self._index_bytes += item.length
        wanted = self._wanted.pop(index.channel_id, None)
        return bool(self._facts.flaw) or wanted == index.records or (wanted is None and not index.records)

    def index(self) -> ChunkIndex:
        """The chunk index that the summary should have for the chunk."""
        facts = self._facts
        return ChunkIndex(
            chunk_length=facts.length,
            chunk_start_offset=facts.offset,
            compression="",
            compressed_size=facts.size,
            message_end_time=facts.end_time,
            message_index_length=self._index_bytes,
            message_index_offsets=self._index_offsets,
            message_start_time=facts.start_time,
            uncompressed_size=facts.size,
        )


def _digest(body: bytes) -> bytes:
    """Stands for a schema or channel, which may be long."""
    return blake2b(body, digest_size=16).digest()


def _body(record: McapRecord) -> bytes:
    """A record's bytes without opcode and length."""
    return records(record)[RECORD.size :]
