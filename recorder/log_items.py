"""What a log consists of, as the reader hands it out."""

from dataclasses import dataclass

from recorder.mcap_layout import RECORD
from rig.clocks import UtcNs


@dataclass(frozen=True, slots=True)
class Message:
    """A message as it stands in the log.

    Attributes:
        topic: channel name.
        channel: channel id.
        sequence: pulse number where the channel has one.
        position: where the message record starts in the chunk's records.
        offset: where its data starts in the file.
        length: bytes of the data.
        data: valid until the next item is read; None if it was not asked for.
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
class Small:
    """Any other record; `body` is what follows opcode and length."""

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
        offset: where the record starts in the file.
        length: bytes of the whole record.
        start_time, end_time: what its head says about the log times in it.
        size: bytes of the records in it.
        messages: those that could be read.
        declarations: schemas and channels that are declared in it (svev declares them before the first chunk).
        flaw: why its content is not to be trusted, empty if it is.
    """

    offset: int
    length: int
    start_time: UtcNs
    end_time: UtcNs
    size: int
    messages: tuple[Message, ...]
    declarations: tuple[Small, ...]
    flaw: str


@dataclass(frozen=True, slots=True)
class Damage:
    """Bytes of the file that are no records.

    Attributes:
        offset: where they start.
        length: how many there are.
        text: what is wrong.
        torn: the file just ends there, as after a crash.
    """

    offset: int
    length: int
    text: str
    torn: bool = False


Item = Chunk | Small | Damage
