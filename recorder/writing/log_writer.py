"""Writes one log: MCAP, profile `svev`, a chunk per triplet, readable up to its last second after a crash."""

import importlib.metadata
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Attachment, Header, Metadata

from recorder.log.channels import schemas_and_channels
from recorder.log.index import LogIndex
from recorder.log.mcap_layout import (
    EVENTS_CHANNEL,
    FIRST_CALIBRATION_CHANNEL,
    HEALTH_CHANNEL,
    JUMPER_CAMERAS_CHANNEL,
    JUMPER_CHANNEL,
    JUMPER_SCENE_CHANNEL,
    MAGIC,
    TAG_CHANNEL,
    chunk_of_one,
    join_pages,
    records,
)
from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.append_file import AppendFile, storage_error
from recorder.writing.write_thread import WriteThread
from rig.clocks import UtcNs
from rig.errors import StorageError
from rig.events import Event, Level
from rig.health import WritingHealth
from rig.phrase import escaped, phrase
from rig.tag import TripletTag
from rig.topics import (
    CALIBRATION_ATTACHMENT,
    EVENTS,
    HEALTH,
    JUMPER,
    JUMPER_CAMERAS,
    JUMPER_SCENE,
    PROFILE,
    RIG_ATTACHMENT,
    RIG_METADATA,
    SESSION_METADATA,
)

CLOSE_TIMEOUT_S = 60.0
_CHANNELS = {
    EVENTS.name: EVENTS_CHANNEL,
    HEALTH.name: HEALTH_CHANNEL,
    JUMPER.name: JUMPER_CHANNEL,
    JUMPER_SCENE.name: JUMPER_SCENE_CHANNEL,
    JUMPER_CAMERAS.name: JUMPER_CAMERAS_CHANNEL,
}


@dataclass(frozen=True, slots=True)
class LogDescription:
    """What a log says of the recording before its first message.

    Attributes:
        session: athlete, bib, gate, wind, notes, operator.
        rig: what a reader should know about the rig without its file: name, cameras, rate.
        rig_toml: the rig file.
        calibration_json: the calibration file, where known.
        calibrations: serialized `foxglove.CameraCalibration` by camera name, where known.
        begin: time of what stands before the first message that is handed over, UTC; None: the computer's.
    """

    session: Mapping[str, str]
    rig: Mapping[str, str]
    rig_toml: bytes
    calibration_json: bytes | None = None
    calibrations: Mapping[str, bytes] = field(default_factory=dict)
    begin: UtcNs | None = None

    @property
    def time(self) -> UtcNs:
        """Time of what stands before the first message that is handed over, UTC."""
        return UtcNs(time.time_ns()) if self.begin is None else self.begin


@dataclass(frozen=True, slots=True)
class LogSummary:
    """What became of a log.

    Attributes:
        bytes: size of the file.
        unwritten: chunks that were handed over and did not reach the disk (after a storage error).
        closed: the end of the log was written.
    """

    bytes: int
    unwritten: int
    closed: bool


class LogWriter:
    """Writes one log file, in a thread of its own; one other thread may call the methods.

    Only the constructor and `close` wait for the disk.

    Attributes:
        path: the file.
    """

    def __init__(self, path: Path, description: LogDescription, buffers: TripletBuffers):
        """Create the file and write the description, durably.

        Args:
            path: must not exist.
            description: what the log says before its first message.
            buffers: `write_pulse` gets their slots.

        Raises:
            BadInputError: the file exists, or cannot be made there.
            StorageError: the disk refuses.
        """
        self.path = path
        self._buffers = buffers
        self._metadata = {SESSION_METADATA: dict(description.session), RIG_METADATA: dict(description.rig)}
        self._written_metadata: dict[str, dict[str, str]] = {}
        self._sequences = dict.fromkeys(_CHANNELS, 0)
        schemas, channels = schemas_and_channels(description.calibrations, buffers.layout.images)
        self._index = LogIndex(schemas, channels)
        self._file = AppendFile(path)
        try:
            self._write_opening(records(*schemas, *channels), description)
            self._thread = WriteThread(self._file, self._index, buffers.release, self._closing_bytes)
        except BaseException as error:
            self._file.discard()
            if isinstance(error, OSError):
                raise storage_error(path, error) from error
            raise
        self._write_first_messages(description)

    def __enter__(self) -> "LogWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def write_pulse(self, tag: TripletTag, slot: int | None, log_time: UtcNs, encoded: bytes | None = None) -> None:
        """Queue a pulse: its tag, and its image if there is one.

        Takes over the caller's hold on the slot, also if it raises.

        Args:
            tag: what became of the pulse.
            slot: of `buffers`, with the pixels; nobody may change them any more. None: write the tag alone.
            log_time: when the triplet was ready, UTC.
            encoded: `tag.encode()`, if the caller has it already.

        Raises:
            StorageError: writing has ended; the message says why and what to do.
            ValueError: the tag is too long.
        """
        if slot is None:
            data = encoded or tag.encode()
            self._write_small(TAG_CHANNEL, tag.pulse, data, tag.time, log_time, is_pulse=True)
            return
        try:
            self._check()
            pages, plan = self._buffers.layout.complete(
                self._buffers.memory(slot), encoded or tag.encode(), tag.pulse, tag.time, log_time
            )
            self._thread.submit(pages, plan, slot, is_pulse=True)
        except BaseException:
            self._buffers.release(slot)
            raise

    def write_event(self, event: Event) -> None:
        """Queue an event; in the file within a second.

        Raises:
            StorageError: writing has ended; the message says why and what to do.
        """
        self.write_message(EVENTS.name, event.to_protobuf(), event.time, event.time)

    def write_health(self, health: bytes, time_utc: UtcNs) -> None:
        """Queue an encoded health record; in the file within a second.

        Raises:
            StorageError: writing has ended; the message says why and what to do.
        """
        self.write_message(HEALTH.name, health, time_utc, time_utc)

    def write_message(
        self, topic: str, data: bytes, publish_time: UtcNs, log_time: UtcNs, sequence: int | None = None
    ) -> None:
        """Queue the data of an event, a health record or a result of the analysis as it stands in a log.

        Args:
            topic: its channel.
            data: the encoded message.
            publish_time: of a result the time of its pulse.
            log_time: when it was ready.
            sequence: of a result the number of its pulse; others are counted.

        Raises:
            StorageError: writing has ended; the message says why and what to do.
            KeyError: no such messages stand on this topic.
        """
        self._sequences[topic] += 1
        number = self._sequences[topic] if sequence is None else sequence
        self._write_small(_CHANNELS[topic], number, data, publish_time, log_time)

    def set_metadata(self, name: str, fields: Mapping[str, str]) -> None:
        """Add or replace a metadata record; it is written when the log is closed, unless the file says the same."""
        self._metadata[name] = dict(fields)

    def statistics(self) -> WritingHealth:
        """How writing goes since the log was opened."""
        return self._thread.statistics()

    @property
    def error(self) -> StorageError | None:
        """Why writing ended, None while it goes on."""
        return self._thread.error

    @property
    def pulses(self) -> int:
        """Pulses that are in the file."""
        return self._thread.pulses

    @property
    def size(self) -> int:
        """Bytes that are in the file."""
        return self._file.size

    @property
    def free_bytes(self) -> int:
        """Room left on the disk about a second ago, in bytes."""
        return self._thread.free_bytes

    def stalled_s(self) -> float:
        """For how long the disk has not finished anything although something waits for it, s."""
        return self._thread.stalled_s()

    def give_up(self, error: StorageError) -> None:
        """End the log with an error found by the caller, e.g. that the disk hangs; do not wait for the disk."""
        self._thread.give_up(error)

    def begin_close(self) -> None:
        """Write what waits and the summary section, and make all of it durable; `over` tells when that is done.

        After an error the log is closed all the same if the disk takes the rest.
        """
        self._thread.stop()

    @property
    def over(self) -> bool:
        """Whether nothing happens to the file any more; `summary` says what became of it."""
        return self._thread.over.is_set()

    @property
    def summary(self) -> LogSummary | None:
        """What became of the log, None until it is over."""
        return LogSummary(self._file.size, self._thread.unwritten, self._thread.closed) if self.over else None

    def close(self) -> LogSummary:
        """Close the log and wait until that is done; a second call only returns the summary.

        Raises:
            StorageError: something that was handed over is not in the file, or the file is not closed.
        """
        summary = self.summary
        if summary is None:
            self.begin_close()
            if not self._thread.over.wait(CLOSE_TIMEOUT_S):
                raise StorageError(
                    f"{self.path}: the disk has not taken the rest within {CLOSE_TIMEOUT_S:g} s; look at `dmesg`, "
                    "and check the log with `svev verify`"
                )
            if self.error is not None:
                raise self.error
        return self.summary or LogSummary(0, 0, closed=False)

    def abandon(self) -> LogSummary | None:
        """Close after an error that has been reported already; None if even closing failed."""
        try:
            return self.close()
        except StorageError:
            return self.summary

    def _check(self) -> None:
        if self._thread.error is not None:
            raise type(self._thread.error)(*self._thread.error.args) from self._thread.error.__cause__
        if self._thread.stopping:
            raise StorageError(f"{self.path}: the log is closed; open another one")

    def _write_small(
        self, channel: int, sequence: int, data: bytes, publish_time: UtcNs, log_time: UtcNs, *, is_pulse: bool = False
    ) -> None:
        self._check()
        chunk, plan = chunk_of_one(channel, sequence, data, publish_time, log_time)
        self._thread.submit(chunk, plan, is_pulse=is_pulse)

    def _write_opening(self, declarations: bytes, description: LogDescription) -> None:
        """Write everything before the first message at once, and make it durable."""
        now = description.time
        out = MAGIC + records(Header(PROFILE, _library())) + declarations
        out += self._changed_metadata(len(out))
        attachments = [Attachment(now, now, RIG_ATTACHMENT, "application/toml", description.rig_toml)]
        if (calibration := description.calibration_json) is not None:
            attachments.append(Attachment(now, now, CALIBRATION_ATTACHMENT, "application/json", calibration))
        for attachment in attachments:
            record = records(attachment)
            self._index.add_attachment(attachment, len(out), len(record))
            out += record
        self._index.add_bytes(0, out)
        self._file.append(join_pages([out]))
        self._file.sync_entry()

    def _changed_metadata(self, position: int) -> bytes:
        """The metadata records that differ from those in the file, as bytes to be written at `position`."""
        out = b""
        for name, fields in self._metadata.items():
            if self._written_metadata.get(name) != fields:
                record = records(Metadata(name, {key: escaped(value) for key, value in fields.items()}))
                self._index.add_metadata(name, position + len(out), len(record))
                self._written_metadata[name] = dict(fields)
                out += record
        return out

    def _write_first_messages(self, description: LogDescription) -> None:
        now = description.time
        for channel, data in enumerate(description.calibrations.values(), FIRST_CALIBRATION_CHANNEL):
            self._write_small(channel, 1, data, now, now)
        if not self._file.direct:
            said = phrase("event_no_direct_io", "the file system takes no direct I/O: writing costs more")
            self.write_event(Event.at(now, Level.WARNING, "recorder", said))

    def _closing_bytes(self) -> bytes:
        metadata = self._changed_metadata(self._file.size)
        self._index.add_bytes(self._file.size, metadata)
        return metadata + self._index.closing_bytes(self._file.size + len(metadata))


def _library() -> str:
    return f"svev {importlib.metadata.version('svev')}"
