"""What stands in a log, as it is read: chunks with their messages, and records that are no chunks."""

from dataclasses import dataclass

from recorder.log.mcap_layout import RECORD
from recorder.reading.records import Damage
from rig.clocks import UtcNs


@dataclass(frozen=True, slots=True)
class Message:
    """A message as it stands in the log.

    Attributes:
        topic: name of its channel.
        channel: id of its channel.
        sequence: pulse number on the channels of tags and images; a count on the others.
        log_time: when the message was ready, UTC.
        publish_time: time of its pulse or event, UTC.
        position: where the message record starts in the chunk's records.
        offset: where its data starts in the file.
        length: bytes of the data.
        data: the data, valid until the next item is read; None if it was not asked for.
    """

    topic: str
    channel: int
    sequence: int
    log_time: UtcNs
    publish_time: UtcNs
    position: int
    offset: int
    length: int
    data: memoryview | None


@dataclass(frozen=True, slots=True)
class SmallRecord:
    """A record that is no chunk; `body` is what follows opcode and length, `offset` where it stands in the file."""

    opcode: int
    offset: int
    body: bytes

    @property
    def length(self) -> int:
        """Bytes of the whole record."""
        return RECORD.size + len(self.body)


@dataclass(frozen=True, slots=True)
class Chunk:
    """A chunk and the messages in it.

    Attributes:
        offset: where the chunk record starts in the file.
        length: bytes of the chunk record.
        start_time, end_time: first and last log time in it, as its head says.
        size: bytes of the records in it.
        messages: its messages, as far as they could be read.
        declarations: schemas and channels that it declares (svev declares them before the first chunk).
        flaw: why its content cannot be trusted, empty if it can.
        crc: CRC-32 of the records in it, as its head says; 0 may mean that it says none.
        checked: that is the CRC-32 of the records in it; False if they were not read.
    """

    offset: int
    length: int
    start_time: UtcNs
    end_time: UtcNs
    size: int
    messages: tuple[Message, ...]
    declarations: tuple[SmallRecord, ...]
    flaw: str
    crc: int
    checked: bool


Item = Chunk | SmallRecord | Damage


def printable(text: str, length: int = 60) -> str:
    """A text from a file as it can stand in a line: control characters escaped, cut off after `length` characters."""
    shown = "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text[: length + 1])
    return shown if len(shown) <= length else f"{shown[:length]}..."
