"""The log that `recover` writes: removed again if recovery fails."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, Self

from msgspec.structs import replace

from recorder.log.triplet_buffers import TripletBuffers
from recorder.reading.items import Message
from recorder.writing.log_writer import LogDescription, LogWriter
from rig.clocks import UtcNs
from rig.errors import StorageError
from rig.events import Event
from rig.images.pixels import MONO8, Pixels, Stored
from rig.tag import TripletTag
from rig.topics import HEALTH

_SLOTS: Final = 4
_DISK_S: Final = 60.0


class RebuiltLog:
    """A new log; a context manager."""

    def __init__(
        self,
        path: Path,
        description: LogDescription,
        shape: tuple[int, int],
        own_topics: Sequence[tuple[str, tuple[int, int]]] = (),
        kind: Pixels = MONO8,
    ) -> None:
        """Create the log.

        Args:
            path: the new log; must not exist.
            description: what it says before its first message.
            shape: rows and columns of its triplets.
            own_topics: name and columns of each camera whose images have a topic of their own.
            kind: how its triplets hold their pixels.

        Raises:
            BadInputError: the new log exists already, or cannot be made.
            StorageError: the disk refuses.
        """
        self._path = path
        self._closed = False
        self._last = description.time
        self._buffers = TripletBuffers(shape, _SLOTS, own_topics, kind)
        try:
            self._writer = LogWriter(path, description, self._buffers)
        except BaseException:
            self._buffers.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if not self._closed:
            self._writer.abandon()
            self._path.unlink(missing_ok=True)
        self._buffers.close()

    def pulse(self, tag: TripletTag, picture: Stored | None, message: Message | None) -> None:
        """Write a pulse.

        Args:
            tag: what became of the pulse.
            picture: its pixels, (rows, columns); None if there are none.
            message: the message that holds the tag unchanged, None if there is none.

        Raises:
            StorageError: the disk refuses.
            ValueError: the tag is too long.
        """
        ready = tag.time if message is None else message.log_time
        self._last = max(self._last, ready)
        encoded = None if message is None or message.data is None else bytes(message.data)
        if picture is None:
            self._writer.write_pulse(tag, None, ready, encoded)
            return
        slot = self._buffers.acquire(_DISK_S)
        if slot is None:
            raise StorageError(f"{self._path}: the disk has taken nothing for {_DISK_S:g} s; look at `dmesg`")
        self._buffers.write(slot, picture)
        self._writer.write_pulse(tag, slot, ready, encoded)

    def other(self, topic: str, data: bytes, publish_time: UtcNs, log_time: UtcNs, sequence: int | None = None) -> None:
        """Write an event, a health record, or a result of the analysis (with `sequence`, the number of its pulse).

        Raises:
            StorageError: the disk refuses.
        """
        if topic == HEALTH.name:  # by the clock of the pulses; events of earlier versions have that of the computer
            self._last = max(self._last, log_time)
        self._writer.write_message(topic, data, publish_time, log_time, sequence)

    def close(self, metadata: Mapping[str, Mapping[str, str]], event: Event) -> int:
        """Finish the log.

        Args:
            metadata: fields of more metadata records, by name.
            event: last event of the log; it gets the log's last time, so that the log ends with its recording.

        Returns:
            Its size in bytes.

        Raises:
            StorageError: the disk refuses.
        """
        self._writer.write_event(replace(event, time=self._last))
        for name, fields in metadata.items():
            self._writer.set_metadata(name, fields)
        size = self._writer.close().bytes
        self._closed = True
        return size
