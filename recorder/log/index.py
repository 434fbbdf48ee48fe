"""Builds the summary section at the end of a log, from what is noted while the log is written."""

import struct
from collections.abc import Sequence

from isal.isal_zlib import crc32
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from recorder.log.crc import combined_crc
from recorder.log.mcap_layout import MAGIC, ChunkPlan, padding, records
from rig.clocks import UtcNs

#: The part of the footer record that its own CRC covers: opcode, length, start of summary and of summary offsets.
FOOTER_BEFORE_CRC = struct.Struct("<BQQQ")


class LogIndex:
    """Notes what is in the file and builds the summary section.

    Keeps chunk indexes as the bytes that the summary will hold (about 100 per triplet), and the CRC of all bytes that
    were written, from the first one of the file on. Everything is noted in the order of the file.

    Attributes:
        messages: number of messages per channel id.
        chunks: number of chunks.
    """

    def __init__(self, schemas: Sequence[Schema], channels: Sequence[Channel]):
        self._schemas = tuple(schemas)
        self._channels = tuple(channels)
        self._chunk_indexes = bytearray()
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self.messages = {channel.id: 0 for channel in channels}
        self.chunks = 0
        self._first = UtcNs(0)
        self._last = UtcNs(0)
        self._covered = 0
        self._crc = 0

    def add_bytes(self, position: int, data: bytes) -> None:
        """Note bytes outside of chunks that were written `position` bytes into the file."""
        self._cover(position, len(data), crc32(data))

    def add_chunk(self, position: int, plan: ChunkPlan) -> None:
        """Note a chunk that was written `position` bytes into the file."""
        self._cover(position, plan.written, plan.crc)
        index = ChunkIndex(
            chunk_length=plan.length,
            chunk_start_offset=position + plan.offset,
            compression="",
            compressed_size=plan.size,
            message_end_time=plan.log_time,
            message_index_length=plan.indexes_length,
            message_index_offsets={channel: position + offset for channel, offset in plan.indexes},
            message_start_time=plan.log_time,
            uncompressed_size=plan.size,
        )
        self._chunk_indexes += records(index)
        for channel, _ in plan.indexes:
            self.messages[channel] += 1
        self._first = min(self._first, plan.log_time) if self.chunks else plan.log_time
        self._last = max(self._last, plan.log_time)
        self.chunks += 1

    def add_attachment(self, attachment: Attachment, position: int, length: int) -> None:
        """Note an attachment whose record of `length` bytes stands `position` bytes into the file."""
        self._attachments.append(attachment_index(attachment, position, length))

    def add_metadata(self, name: str, position: int, length: int) -> None:
        """Note a metadata record of `length` bytes that stands `position` bytes into the file."""
        self._metadata.append(MetadataIndex(position, length, name))

    def closing_bytes(self, position: int) -> bytes:
        """Everything from the end of the data section to the end of the file.

        Args:
            position: where these bytes will stand in the file.
        """
        self._cover(position, 0, 0)
        data_end = records(DataEnd(self._crc))
        start = position + len(data_end)
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts={channel: count for channel, count in self.messages.items() if count},
            chunk_count=self.chunks,
            message_count=sum(self.messages.values()),
            message_end_time=self._last,
            message_start_time=self._first,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        summary, offsets = bytearray(), RecordBuilder()
        groups: tuple[tuple[Opcode, bytes], ...] = (
            (Opcode.SCHEMA, records(*self._schemas)),
            (Opcode.CHANNEL, records(*self._channels)),
            (Opcode.STATISTICS, records(statistics)),
            (Opcode.CHUNK_INDEX, bytes(self._chunk_indexes)),
            (Opcode.ATTACHMENT_INDEX, records(*self._attachments)),
            (Opcode.METADATA_INDEX, records(*self._metadata)),
        )
        for opcode, group in groups:
            if group:
                SummaryOffset(opcode, start + len(summary), len(group)).write(offsets)
                summary += group
        offsets_start = start + len(summary)
        summary += offsets.end()  # type: ignore[no-untyped-call]
        return data_end + bytes(summary) + footer(bytes(summary), start, offsets_start) + MAGIC

    def _cover(self, position: int, length: int, crc: int) -> None:
        """Take the next written bytes into the CRC of the data section; what was left out before them is padding."""
        if position > self._covered:
            self._crc = crc32(padding(position - self._covered), self._crc)
        self._crc = combined_crc(self._crc, crc, length)
        self._covered = position + length


def attachment_index(attachment: Attachment, position: int, length: int) -> AttachmentIndex:
    """What the summary says about an attachment whose record of `length` bytes stands at `position`."""
    return AttachmentIndex(
        position, length, attachment.log_time, attachment.create_time, len(attachment.data), attachment.name,
        attachment.media_type,
    )  # fmt: skip


def footer(summary: bytes, start: int, offsets_start: int) -> bytes:
    """The footer record: where summary and summary offsets start, and the CRC over the summary and itself."""
    before_crc = FOOTER_BEFORE_CRC.pack(Opcode.FOOTER, 8 + 8 + 4, start, offsets_start)
    footer_record: McapRecord = Footer(start, offsets_start, crc32(before_crc, crc32(summary)))
    return records(footer_record)
