"""Reads a log from front to back in constant memory, also one that is cut off, damaged or still being written."""

import struct
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

from isal.isal_zlib import crc32
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata

from recorder.log.channels import schemas_and_channels
from recorder.log.mcap_layout import FIRST_CAMERA_CHANNEL, MAGIC, MESSAGE, PADDING_OPCODE, RECORD
from recorder.reading.coded_images import with_images
from recorder.reading.items import Chunk, Item, Message, SmallRecord, printable
from recorder.reading.records import CHUNK_HEAD, Damage, FileWindow, RawRecord, chunks_anywhere, is_closed, walk
from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.topics import (
    CALIBRATION_ATTACHMENT,
    CAMERA_TOPIC,
    NOTES,
    PROFILE,
    RESULTS,
    RIG_ATTACHMENT,
    TAG,
)

#: Of our metadata records, these first many, and of attachments these are kept.
_METADATA_BEGINS, _METADATA_MAX = "svev.", 64
_ATTACHMENTS = (RIG_ATTACHMENT, CALIBRATION_ATTACHMENT)
#: So many channels, records in a chunk, and bytes of a message on these topics are taken, so that no file can use up
#: the memory; ours have a few.
_CHANNELS_MAX, _RECORDS_MAX, _SMALL_MAX = 1000, 1 << 16, 1 << 16
_NAME_MAX = 1000
_SMALL_TOPICS = (TAG.name, *NOTES, *RESULTS)

_CAMERAS_MAX = 8
#: What the `mcap` library raises on bytes that are not the record that it is asked to read.
UNREADABLE = (struct.error, ValueError, OverflowError, McapError)


class ForeignFileError(BadInputError):
    """The file is not a log of svev, not even a damaged one."""


class LogReader:
    """One log, open for reading.

    Attributes:
        path: the log.
        status: of the file when it was opened.
        size: its bytes then.
        closed: the log was closed properly: it ends in a footer.
        truncated: the log ends in the middle of a record; known only when it has been read to its end.
        has_camera_topics: the log declares images of single cameras, as far as it has been read.
        library: the program that wrote it, empty if `salvage`.
        metadata: fields of our metadata records by name, the last of each, as far as the log has been read.
        attachments: contents of our attachments by name, as far as the log has been read, if it is read in full.
        data_crc: CRC-32 of all bytes from the first one of the file to the data end record, None until `items` has
            come to that record without meeting damage, and always if it does not read everything.
    """

    def __init__(self, path: Path, *, skim: bool = False, salvage: bool = False, links: bool = True) -> None:
        """Open the log and check its header.

        Args:
            path: the log.
            skim: the caller will read only small parts of it.
            salvage: read it even if its beginning is destroyed: check no header, and assume the channels that all our
                logs declare there.
            links: whether a link of this name is followed; not in a folder of recordings.

        Raises:
            BadInputError: no such file, no MCAP log, or not one of ours.
        """
        self.path = path
        self.metadata: dict[str, dict[str, str]] = {}
        self.attachments: dict[str, bytes] = {}
        self.truncated = False
        self.data_crc: int | None = None
        self.has_camera_topics = False
        self._assumed = _usual_channels() if salvage else {}
        self._topics = dict(self._assumed)
        self._window = FileWindow(path, direct=not skim, links=links)
        self.status = self._window.status
        self.size = self._window.size
        try:
            self.library = "" if salvage else self._check_header()
            self.closed = is_closed(self._window)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> "LogReader":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def items(self, only: Collection[str] | None = None) -> Iterator[Item]:
        """Everything in the log but padding, in the order of the file.

        Args:
            only: read the data of messages on these topics alone, and check no checksums; None: read and check all.

        Raises:
            BadInputError: the disk cannot read the file.
        """
        crc = crc32(self._window.read(0, len(MAGIC))) if only is None else None
        for record in walk(self._window, len(MAGIC), self.size):
            if isinstance(record, Damage):
                crc = None
            elif record.opcode == Opcode.DATA_END:
                self.data_crc, crc = crc, None
            elif crc is not None:
                crc = crc32(self._window.read(record.offset, record.length), crc)
            if (item := self._item(record, only)) is not None:
                yield item

    def items_between(self, begin: int, end: int) -> Iterator[Item]:
        """Everything that stands between two places of the file, read and checked.

        Raises:
            BadInputError: the disk cannot read the file.
        """
        for record in walk(self._window, begin, end):
            if (item := self._item(record, None)) is not None:
                yield item

    def next_sound_chunk(self, begin: int) -> Chunk | None:
        """The first chunk from `begin` on, at any offset, whose checksum is right and whose records can be read.

        Raises:
            BadInputError: the disk cannot read the file.
        """
        for record in chunks_anywhere(self._window, begin):
            chunk = self._chunk(record, None)
            if chunk.checked and not chunk.flaw:
                return chunk
        return None

    def sound_chunks(self, only: Collection[str] | None = None) -> Iterator[Chunk]:
        """The chunks without a flaw; `only` as for `items`."""
        return (item for item in self.items(only) if isinstance(item, Chunk) and not item.flaw)

    def messages(self, *topics: str) -> Iterator[Message]:
        """The messages on these topics, from chunks without a flaw."""
        return (message for chunk in self.sound_chunks() for message in chunk.messages if message.topic in topics)

    def chunk(self, offset: int, length: int) -> Chunk:
        """A chunk that `items` has handed out, by this reader or another: with all its data, and checked."""
        if not self._topics:  # channels are declared before the first chunk
            next((item for item in self.items(only=()) if isinstance(item, Chunk)), None)
        return self._chunk(RawRecord(Opcode.CHUNK, offset, length), None)

    def read(self, offset: int, length: int) -> memoryview:
        """Bytes of the file, valid until anything else is read."""
        return self._window.read(offset, length)

    def has_grown(self) -> bool:
        """Whether the log is longer now than when it was opened: somebody is writing it."""
        return self._window.has_grown()

    def data_from(self, offset: int) -> int:
        """The first byte from `offset` on that is not in a hole of the file; its size if there is none."""
        return self._window.data_from(offset)

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
                f"{self.path}: is an MCAP log, but not written by svev "
                f'(profile "{printable(header.profile)}"); name a log of svev'
            )
        return printable(header.library)

    def _item(self, record: RawRecord | Damage, only: Collection[str] | None) -> Item | None:
        """What a record holds; None for padding and for what is not asked for."""
        if isinstance(record, Damage):
            self.truncated = self.truncated or record.torn
            return record
        if record.opcode == Opcode.CHUNK:
            return self._chunk(record, only)
        if record.opcode == PADDING_OPCODE:
            return None
        if only is not None and record.opcode not in (Opcode.CHANNEL, Opcode.METADATA):
            return None
        return self._small(record)

    def _small(self, record: RawRecord) -> SmallRecord | Damage:
        body = bytes(self._window.read(record.offset + RECORD.size, record.length - RECORD.size))
        try:
            match record.opcode:
                case Opcode.CHANNEL:
                    channel = Channel.read(stream(body))
                    if len(self._topics) >= _CHANNELS_MAX:
                        raise ValueError(f"more than {_CHANNELS_MAX} channels")
                    _check_name(channel.topic)
                    self._topics[channel.id] = self._assumed.get(channel.id, channel.topic)
                    self.has_camera_topics |= channel.topic.startswith(CAMERA_TOPIC)
                case Opcode.METADATA:
                    metadata = Metadata.read(stream(body))
                    _check_name(metadata.name)
                    room = len(self.metadata) < _METADATA_MAX or metadata.name in self.metadata
                    if metadata.name.startswith(_METADATA_BEGINS) and room:
                        self.metadata[metadata.name] = metadata.metadata
                case Opcode.ATTACHMENT:
                    attachment = Attachment.read(stream(body))
                    _check_name(attachment.name, attachment.media_type)
                    if crc32(memoryview(body)[:-4]) != int.from_bytes(body[-4:], "little"):
                        text = f"checksum of attachment {printable(attachment.name)} is wrong"
                        return Damage(record.offset, record.length, text)
                    if attachment.name in _ATTACHMENTS:
                        self.attachments[attachment.name] = attachment.data
        except UNREADABLE as error:
            name = Opcode(record.opcode).name.lower()
            return Damage(record.offset, record.length, f"unreadable {name} record: {error}")
        return SmallRecord(record.opcode, record.offset, body)

    def _chunk(self, record: RawRecord, only: Collection[str] | None) -> Chunk:
        begin = record.offset + RECORD.size
        end = record.offset + record.length
        if only is None:  # one read brings the whole chunk into the window; all reads below find it there
            self._window.read(record.offset, record.length)
        start_time, end_time, size, crc, name_bytes = CHUNK_HEAD.unpack(self._window.read(begin, CHUNK_HEAD.size))
        first = begin + CHUNK_HEAD.size + name_bytes + 8
        checked = only is None and crc32(self._window.read(first, end - first)) == crc
        messages: list[Message] = []
        declarations: list[SmallRecord] = []
        if name_bytes:
            flaw = "it is compressed; rewrite the log with `mcap decompress`"
        else:
            wrong = only is None and crc and not checked
            trouble = self._content(first, end, only, messages, declarations)
            flaw = "its checksum is wrong" if wrong else trouble
        if only is None and not flaw:
            messages, flaw = with_images(messages)
        return Chunk(
            record.offset, record.length, UtcNs(start_time), UtcNs(end_time), size,
            tuple(messages), tuple(declarations), flaw, crc, checked,
        )  # fmt: skip

    def _content(
        self,
        first: int,
        end: int,
        only: Collection[str] | None,
        messages: list[Message],
        declarations: list[SmallRecord],
    ) -> str:
        """Read the records of a chunk into the two lists.

        Returns:
            What is wrong with them, empty if nothing.
        """
        position, count = first, 0
        while position < end:
            count += 1
            if count > _RECORDS_MAX:
                return f"it holds more than {_RECORDS_MAX} records"
            head = bytes(self._window.read(position, min(MESSAGE.size, end - position)))
            opcode, length = RECORD.unpack(head[: RECORD.size]) if len(head) >= RECORD.size else (0, end)
            following = position + RECORD.size + length
            if following > end:
                return "its records overrun its end"
            if opcode == 0:  # no opcode at all: zeros where records were
                return "zeros stand in place of its records"
            if opcode == Opcode.MESSAGE:
                message = self._message(head, position, first, following, only)
                if isinstance(message, str):
                    return message
                messages.append(message)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                declaration = self._small(RawRecord(opcode, position, following - position))
                if not isinstance(declaration, SmallRecord):
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
        if channel not in self._topics:
            return "a message in it is of a channel that is not declared"
        topic = self._topics[channel]
        offset = position + MESSAGE.size
        if topic in _SMALL_TOPICS and following - offset > _SMALL_MAX:
            return f"a message in it on {topic} is longer than {_SMALL_MAX} bytes"
        data: memoryview | None = None
        if only is None:
            data = self._window.read(offset, following - offset)
        elif topic in only:  # copied, because the window moves on before the chunk is complete
            data = memoryview(bytes(self._window.read(offset, following - offset)))
        return Message(
            topic, channel, sequence, UtcNs(log_time), UtcNs(publish_time), position - first,
            offset, following - offset, data,
        )  # fmt: skip


def stream(body: bytes) -> Any:
    """A record's body as a stream, from which the `mcap` library's record classes read."""
    return ReadDataStream(BytesIO(body))


def _check_name(*names: str) -> None:
    """Refuse names that are too long to be kept.

    Raises:
        ValueError: one is.
    """
    if any(len(name) > _NAME_MAX for name in names):
        raise ValueError(f"a name of more than {_NAME_MAX} letters")


def _usual_channels() -> dict[int, str]:
    """Topics by channel in all our logs; cameras by their places, because only their log knows their names."""
    usual = {channel.id: channel.topic for channel in schemas_and_channels()[1]}
    return usual | {FIRST_CAMERA_CHANNEL + place: f"{CAMERA_TOPIC}{place + 1}" for place in range(_CAMERAS_MAX)}
