"""Writes a log again with its images coded without loss, and reads it back.

Every other byte of the log that says something stays: tags, events, health, results, metadata, attachments. Padding
goes. What the recorder's checksum of a chunk was, stands in the new image message, so that whoever reads the new log
checks each frame against what the recorder had in memory.
"""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO, Final

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, DataEnd, Metadata, Schema

from recorder.checking.verify import verify
from recorder.log.coded_image import CodedImage, coded_schema
from recorder.log.ffv1 import CODEC, Encoder
from recorder.log.index import LogIndex
from recorder.log.mcap_layout import MAGIC, RECORD, chunk_of, message_head, pixels_field, records
from recorder.log.write_lock import is_being_written
from recorder.reading.coded_images import is_image, records_crc
from recorder.reading.items import Chunk, Message, SmallRecord
from recorder.reading.log_reader import LogReader, stream
from recorder.reading.records import Damage
from recorder.reading.triplets import pixels, view_image
from recorder.recovering.unfinished_log import check_target, unfinished_log
from rig.errors import BadInputError, LogDamagedError, StorageError
from rig.host.disk import sync
from rig.images.pixels import Stored
from rig.phrase import escaped
from rig.topics import COMPACT_METADATA, TAG, TRIPLET
from triggering.ledger.account import Ledger

_MAKE_WHOLE: Final = "make a whole log of it with svev recover, and compact that one"


@dataclass(frozen=True, slots=True)
class CompactReport:
    """What was written.

    Attributes:
        source: the log that was read.
        path: the log that was written.
        bytes_before, bytes: size of both.
        ledger: what became of every pulse, as read back from the new log.
    """

    source: Path
    path: Path
    bytes_before: int
    bytes: int
    ledger: Ledger

    @property
    def ratio(self) -> float:
        """How many times smaller the new log is."""
        return self.bytes_before / self.bytes

    def to_json(self) -> dict[str, object]:
        """The report as one JSON object."""
        return {
            "source": str(self.source),
            "log": str(self.path),
            "bytes_before": self.bytes_before,
            "bytes": self.bytes,
            "ratio": round(self.ratio, 4),
            **self.ledger.counts().model_dump(),
        }


def compact(source: Path, target: Path, progress: Callable[[int], None] | None = None) -> CompactReport:
    """Write `source` with coded images, and read the new log back: every byte, every frame.

    Args:
        source: the log; it is only read.
        target: must not exist.
        progress: called with the number of bytes that are done, twice the size of `source` at the end.

    Raises:
        BadInputError: no such file, no log of svev, compacted already, not as a recorder writes it, or the target
            exists or cannot be made.
        LogDamagedError: the log was not closed or is damaged.
        StorageError: the disk refuses, or what was read back is not what was written; nothing of the new log is left.
    """
    check_target(target)
    done = progress or (lambda _: None)
    with LogReader(source) as reader:
        if not reader.closed and is_being_written(source):
            raise LogDamagedError(f"{source}: is still being written; compact it when the recording has ended")
        if not reader.closed:
            raise LogDamagedError(f"{source}: was not closed; {_MAKE_WHOLE}")
        with unfinished_log(target) as path:
            with path.open("xb") as file:
                writing = _Writing(reader, file)
                writing.write(done)
            sync(path)
            size = path.stat().st_size
            back = verify(path, lambda position: done(reader.size + position * reader.size // size))
            if back.damaged or back.ledger.pulses != writing.pulses:
                first = next(iter(back.findings), f"it has {back.ledger.pulses} pulses instead of {writing.pulses}")
                raise StorageError(
                    f"{target}: was read back otherwise than it was written ({first}); nothing of it is left: examine "
                    "disk and memory of this computer"
                )
        return CompactReport(source, target, reader.size, size, back.ledger)


class _Writing:
    """Writes the new log.

    Attributes:
        pulses: tags that have been written.
    """

    def __init__(self, reader: LogReader, file: BinaryIO) -> None:
        self._reader, self._file = reader, file
        self._position = 0
        self._opening = bytearray()
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._index: LogIndex | None = None
        self._encoders: dict[tuple[tuple[int, int], int], Encoder] = {}
        self.pulses = 0

    def write(self, progress: Callable[[int], None]) -> None:
        """Write everything.

        Raises:
            BadInputError, LogDamagedError: as for `compact`.
        """
        self._put_record(MAGIC)
        for item in self._reader.items():
            match item:
                case Damage():
                    raise self._damaged(item.offset, item.text)
                case Chunk() if item.flaw:
                    raise self._damaged(item.offset, item.flaw)
                case Chunk():
                    self._chunk(item)
                case SmallRecord(opcode=Opcode.DATA_END):
                    if DataEnd.read(stream(item.body)).data_section_crc not in (0, self._reader.data_crc):
                        raise self._damaged(item.offset, "the checksum of everything before the summary is wrong")
                    self._put(self._begun().closing_bytes(self._position))
                    return
                case SmallRecord():
                    self._record(item)
            progress(item.offset + item.length)
        raise self._damaged(self._reader.size, "it does not say where its data ends")

    def _record(self, item: SmallRecord) -> None:
        """Copy a record that is no chunk; the schema of images becomes that of coded ones."""
        record = RECORD.pack(item.opcode, len(item.body)) + item.body
        match item.opcode:
            case Opcode.HEADER:
                pass
            case Opcode.SCHEMA if self._index is None:
                schema = Schema.read(stream(item.body))
                self._schemas.append(coded_schema(schema.id) if schema.name == TRIPLET.schema else schema)
                record = records(self._schemas[-1])
            case Opcode.CHANNEL if self._index is None:
                self._channels.append(Channel.read(stream(item.body)))
            case Opcode.METADATA:
                name, index = Metadata.read(stream(item.body)).name, self._begun()
                if name == COMPACT_METADATA:
                    raise BadInputError(f"{self._reader.path}: is compacted already; copy it as it is")
                index.add_metadata(name, self._position, len(record))
            case Opcode.ATTACHMENT:
                attachment, index = Attachment.read(stream(item.body)), self._begun()
                index.add_attachment(attachment, self._position, len(record))
            case Opcode.MESSAGE_INDEX:
                return  # the new chunks come with theirs
            case _:
                raise self._foreign(item.offset)
        self._put_record(record)

    def _begun(self) -> LogIndex:
        """The index. When it is asked for first, all declarations are there, and the log says what it is."""
        if self._index is None:
            self._index = LogIndex(self._schemas, self._channels)
            self._index.add_bytes(0, bytes(self._opening))
            fields = {
                "source": escaped(self._reader.path.name),
                "bytes": str(self._reader.size),
                "codec": CODEC,
                "time": datetime.now(UTC).isoformat(timespec="seconds"),
            }
            said = records(Metadata(COMPACT_METADATA, fields))
            self._index.add_metadata(COMPACT_METADATA, self._position, len(said))
            self._put_record(said)
        return self._index

    def _chunk(self, chunk: Chunk) -> None:
        """Write a chunk with its images coded."""
        channels = [message.channel for message in chunk.messages]
        times = {message.log_time for message in chunk.messages}
        recorded = records_crc(chunk.messages)
        if recorded != chunk.crc or len(set(channels)) < len(channels) or times != {chunk.start_time, chunk.end_time}:
            raise self._foreign(chunk.offset)
        index = self._begun()
        messages = [(message.channel, self._message(message, recorded)) for message in chunk.messages]
        data, plan = chunk_of(chunk.start_time, messages)
        index.add_chunk(self._position, plan)
        self._put(data)
        self.pulses += sum(message.topic == TAG.name for message in chunk.messages)

    def _message(self, message: Message, recorded_crc: int) -> bytes:
        """The record of a message; of an image, that of the coded one."""
        data: bytes | memoryview = message.data or memoryview(b"")
        if is_image(message):
            data = self._coded(memoryview(data), recorded_crc, message)
        head = message_head(message.channel, message.sequence, len(data), message.publish_time, message.log_time)
        return head + data

    def _coded(self, data: memoryview, recorded_crc: int, message: Message) -> bytes:
        try:
            view = view_image(data)
            picture = pixels(view)
        except ValueError as error:
            raise self._damaged(message.offset, f"the image of pulse {message.sequence}: {error}") from None
        prefix = pixels_field((view.rows, view.columns), view.kind)
        head = bytes(data[: len(data) - len(view.pixels)])
        if not head.endswith(prefix):
            raise self._foreign(message.offset)
        return CodedImage(head.removesuffix(prefix), CODEC, recorded_crc, self._encoded(picture)).encode()

    def _encoded(self, picture: Stored) -> bytes:
        key = picture.shape, picture.itemsize
        encoder = self._encoders.get(key) or self._encoders.setdefault(key, Encoder(*key))
        return encoder(picture)

    def _put_record(self, record: bytes) -> None:
        """Write what stands outside of chunks."""
        if self._index is None:
            self._opening += record
        else:
            self._index.add_bytes(self._position, record)
        self._put(record)

    def _put(self, data: bytes) -> None:
        self._file.write(data)
        self._position += len(data)

    def _damaged(self, offset: int, what: str) -> LogDamagedError:
        return LogDamagedError(f"{self._reader.path}: {what}, at byte {offset}: {_MAKE_WHOLE}")

    def _foreign(self, offset: int) -> BadInputError:
        return BadInputError(
            f"{self._reader.path}: holds what no recorder of svev writes, at byte {offset}: write it anew with "
            "svev recover, and compact that one"
        )
