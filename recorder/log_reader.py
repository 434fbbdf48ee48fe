"""Reads a log from front to back at constant memory, also one that is cut off, damaged or still being written."""

import struct
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from isal.isal_zlib import crc32
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata
from numpy.typing import NDArray

from recorder.file_window import FileWindow
from recorder.ledger import runs_from_text
from recorder.log_channels import schemas_and_channels
from recorder.log_items import Chunk, Damage, Item, Message, Small
from recorder.mcap_layout import MAGIC, MESSAGE, PADDING_OPCODE, RECORD
from recorder.raw_image import pixels, view_image
from recorder.record_walk import CHUNK_HEAD, RawRecord, is_closed, walk
from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.tag import TripletTag
from rig.topics import PROFILE, RECOVERY_METADATA, TAG, TRIPLET

#: What the `mcap` library raises on bytes that are no such record.
UNREADABLE = (struct.error, ValueError, OverflowError, McapError)


class ForeignFileError(BadInputError):
    """The file is no log of svev and never was."""


class LogReader:
    """One log, open for reading.

    Attributes:
        path: the log.
        size: bytes of the file when it was opened.
        closed: the log was closed properly: it ends in a footer.
        truncated: it ends in the middle of a record, as far as it has been read.
        library: who wrote it.
        channels: by id, as far as the log has been read.
        metadata: fields of the metadata records by name, the last of each, as far as the log has been read.
        attachments: contents by name, as far as the log has been read.
    """

    def __init__(self, path: Path, *, skim: bool = False, salvage: bool = False) -> None:
        """Open the log and see that it is one.

        Args:
            path: the log.
            skim: only small parts of it will be read.
            salvage: read it even if its beginning is destroyed, taking for granted what all our logs declare there.

        Raises:
            BadInputError: no such file, no MCAP log, or not one of ours.
        """
        self.path = path
        self.channels: dict[int, Channel] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.attachments: dict[str, bytes] = {}
        self.truncated = False
        self._declared = {channel.id: channel for channel in schemas_and_channels()[1]} if salvage else {}
        self.channels |= self._declared
        self._window = FileWindow(path, direct=not skim)
        self.size = self._window.size
        try:
            self.library = "" if salvage else self._check_header()
            self.closed = is_closed(self._window)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "LogReader":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def items(self, only: Collection[str] | None = None) -> Iterator[Item]:
        """Everything in the log, in the order of the file, padding left out.

        Args:
            only: read the data of messages on these topics alone, and check no checksums; None: read and check all.
        """
        for record in walk(self._window):
            if isinstance(record, Damage):
                self.truncated = self.truncated or record.torn
                yield record
            elif record.opcode == Opcode.CHUNK:
                yield self._chunk(record, only)
            elif record.opcode != PADDING_OPCODE:
                yield self._small(record)

    def messages(self, *topics: str) -> Iterator[Message]:
        """The messages on these topics, from chunks that are sound."""
        for item in self.items():
            if isinstance(item, Chunk) and not item.flaw:
                yield from (message for message in item.messages if message.topic in topics)

    def read(self, offset: int, length: int) -> memoryview:
        """Bytes of the file, valid until anything else is read."""
        return self._window.read(offset, length)

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        self._window.close()

    def _check_header(self) -> str:
        if self.size == 0:
            raise BadInputError(f"{self.path}: is empty; name a log of svev")
        if bytes(self._window.read(0, len(MAGIC))) != MAGIC:
            raise ForeignFileError(f"{self.path}: is not an MCAP log; name a log of svev")
        head = self._window.read(len(MAGIC), RECORD.size)
        opcode, length = RECORD.unpack(head) if len(head) == RECORD.size else (0, 0)
        body = bytes(self._window.read(len(MAGIC) + RECORD.size, length)) if length <= 1 << 16 else b""
        try:
            header = Header.read(stream(body))
        except UNREADABLE:
            header = None
        if opcode != Opcode.HEADER or len(body) < length or header is None:
            raise BadInputError(f"{self.path}: is cut off or damaged before it says what it is; nothing can be read")
        if header.profile != PROFILE:
            raise ForeignFileError(
                f'{self.path}: is an MCAP log, but not written by svev (profile "{header.profile}"); name a log of svev'
            )
        return str(header.library)

    def _small(self, record: RawRecord) -> Small | Damage:
        body = bytes(self._window.read(record.offset + RECORD.size, record.length - RECORD.size))
        try:
            match record.opcode:
                case Opcode.CHANNEL:
                    channel = Channel.read(stream(body))
                    self.channels[channel.id] = self._declared.get(channel.id, channel)
                case Opcode.METADATA:
                    metadata = Metadata.read(stream(body))
                    self.metadata[metadata.name] = metadata.metadata
                case Opcode.ATTACHMENT:
                    attachment = Attachment.read(stream(body))
                    if crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
                        return Damage(
                            record.offset, record.length, f"checksum of attachment {attachment.name} is wrong"
                        )
                    self.attachments[attachment.name] = attachment.data
        except UNREADABLE as error:
            name = Opcode(record.opcode).name.lower()
            return Damage(record.offset, record.length, f"unreadable {name} record: {error}")
        return Small(record.opcode, record.offset, body)

    def _chunk(self, record: RawRecord, only: Collection[str] | None) -> Chunk:
        begin = record.offset + RECORD.size
        end = record.offset + record.length
        if only is None:  # the whole chunk into the window: what is read below is in it
            self._window.read(record.offset, record.length)
        start_time, end_time, size, crc, name_bytes = CHUNK_HEAD.unpack(self._window.read(begin, CHUNK_HEAD.size))
        first = begin + CHUNK_HEAD.size + name_bytes + 8
        messages: list[Message] = []
        declarations: list[Small] = []
        if name_bytes:
            flaw = "it is compressed; rewrite the log with `mcap decompress`"
        else:
            wrong = only is None and crc and crc32(self._window.read(first, end - first)) != crc
            trouble = self._content(first, end, only, messages, declarations)
            flaw = "its checksum is wrong" if wrong else trouble
        return Chunk(
            record.offset, record.length, UtcNs(start_time), UtcNs(end_time), size,
            tuple(messages), tuple(declarations), flaw,
        )  # fmt: skip

    def _content(
        self, first: int, end: int, only: Collection[str] | None, messages: list[Message], declarations: list[Small]
    ) -> str:
        """Read the records of a chunk into the two lists; what is wrong with them, empty if nothing."""
        position = first
        while position < end:
            head = bytes(self._window.read(position, min(MESSAGE.size, end - position)))
            opcode, length = RECORD.unpack(head[: RECORD.size]) if len(head) >= RECORD.size else (0, end)
            following = position + RECORD.size + length
            if following > end:
                return "its records overrun its end"
            if opcode == Opcode.MESSAGE:
                message = self._message(head, position, first, following, only)
                if isinstance(message, str):
                    return message
                messages.append(message)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                declaration = self._small(RawRecord(opcode, position, following - position))
                if not isinstance(declaration, Small):
                    return f"a declaration in it is an {declaration.text}"
                declarations.append(declaration)
            position = following
        return ""

    def _message(
        self, head: bytes, position: int, first: int, following: int, only: Collection[str] | None
    ) -> Message | str:
        """The message at `position`, or what is wrong with it."""
        if following - position < MESSAGE.size:
            return "a message in it is too short"
        _, _, channel, sequence, log_time, publish_time = MESSAGE.unpack(head)
        if channel not in self.channels:
            return "a message in it is of a channel that is not declared"
        topic = self.channels[channel].topic
        offset = position + MESSAGE.size
        data: memoryview | None = None
        if only is None:
            data = self._window.read(offset, following - offset)
        elif topic in only:  # small, and the window moves on before the chunk is complete
            data = memoryview(bytes(self._window.read(offset, following - offset)))
        return Message(
            topic, channel, sequence, UtcNs(log_time), UtcNs(publish_time), position - first,
            offset, following - offset, data,
        )  # fmt: skip


def triplets(path: Path) -> Iterator[tuple[TripletTag, NDArray[np.uint8]]]:
    """Every pulse of a log: its tag, and its image, (rows, columns), valid until the next one is taken.

    The block of a camera that is not ok is black; so is the whole image of a pulse that has none. Pulses in parts of
    the log that are damaged are left out.

    Raises:
        BadInputError: no such file, no MCAP log, or not one of ours.
        ValueError: a chunk is sound, but what it holds is no tag or no image.
    """
    with LogReader(path) as reader:
        for item in reader.items():
            if isinstance(item, Chunk) and not item.flaw:
                images = {message.sequence: message.data for message in item.messages if message.topic == TRIPLET.name}
                for message in item.messages:
                    if message.topic == TAG.name and message.data is not None:
                        tag = TripletTag.decode(message.data)
                        data = images.get(tag.pulse)
                        yield tag, np.zeros(tag.shape, np.uint8) if data is None else pixels(view_image(data))


def tag_of(message: Message) -> TripletTag | None:
    """The tag in a message; None for other messages, and for a damaged tag (which `verify` reports)."""
    if message.topic != TAG.name or message.data is None:
        return None
    try:
        return TripletTag.decode(message.data)
    except (ValueError, KeyError, TypeError):
        return None


def known_lost(reader: LogReader) -> tuple[tuple[int, int], ...]:
    """Runs of pulses of which a log that has been read says that they were lost when it was recovered."""
    return tuple(runs_from_text(reader.metadata.get(RECOVERY_METADATA, {}).get("lost_pulses", "")))


def stream(body: bytes) -> Any:
    """A record's body as the `mcap` library's record classes read it."""
    return ReadDataStream(BytesIO(body))
