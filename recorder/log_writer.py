"""Writes one log: MCAP, profile `svev`, a chunk per triplet, readable up to its last second whatever happens."""

import importlib.metadata
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from mcap.records import Attachment, AttachmentIndex, Header, Metadata

from recorder.append_file import AppendFile, storage_error
from recorder.events import Event, Level
from recorder.log_channels import schemas_and_channels
from recorder.log_index import LogIndex
from recorder.mcap_layout import (
    EVENTS_CHANNEL,
    FIRST_CALIBRATION_CHANNEL,
    HEALTH_CHANNEL,
    MAGIC,
    TAG_CHANNEL,
    chunk_of_one,
    join_pages,
    records,
)
from recorder.triplet_buffers import TripletBuffers
from recorder.write_thread import WriteThread
from rig.clocks import UtcNs
from rig.errors import StorageError
from rig.tag import TripletTag
from rig.topics import CALIBRATION_ATTACHMENT, EVENTS, HEALTH, PROFILE, RIG_ATTACHMENT, RIG_METADATA, SESSION_METADATA

CLOSE_TIMEOUT_S = 60.0
_CHANNELS = {EVENTS.name: EVENTS_CHANNEL, HEALTH.name: HEALTH_CHANNEL}


@dataclass(frozen=True, slots=True)
class LogSummary:
    """What a closed log holds.

    Attributes:
        messages: number of messages per topic.
        bytes: size of the file.
        unwritten: chunks that were handed over and did not reach the disk (after a storage error).
    """

    path: Path
    messages: Mapping[str, int]
    chunks: int
    bytes: int
    unwritten: int


class LogWriter:
    """One log file. Methods may be called from one thread; writing happens in a thread of its own.

    Attributes:
        path: the file.
        summary: what the log holds, None until `close` has been called.
    """

    def __init__(
        self,
        path: Path,
        shape: tuple[int, int],
        *,
        session: Mapping[str, str],
        rig: Mapping[str, str],
        rig_toml: bytes,
        buffers: TripletBuffers,
        calibration_json: bytes | None = None,
        calibrations: Mapping[str, bytes] | None = None,
        on_released: Callable[[int], None] | None = None,
    ):
        """Create the file and write, durably, what it is.

        Args:
            path: must not exist.
            shape: rows and columns of the triplet, those of `buffers`.
            session: athlete, bib, gate, wind, notes, operator.
            rig: what a reader should know about the rig without its file: name, cameras, rate.
            rig_toml: the rig file.
            buffers: whose slots `write_triplet` gets.
            calibration_json: the calibration file, where known.
            calibrations: serialized `foxglove.CameraCalibration` by camera name, where known.
            on_released: called from the writing thread with each slot that it let go.

        Raises:
            BadInputError: the file exists, or cannot be made there.
            StorageError: the disk refuses.
            ValueError: shape and buffers do not fit.
        """
        if shape != buffers.shape:
            raise ValueError(f"shape {shape} is not that of the buffers, {buffers.shape}: use one of them")
        self.path = path
        self.summary: LogSummary | None = None
        self._buffers = buffers
        self._on_released = on_released
        self._metadata = {SESSION_METADATA: dict(session), RIG_METADATA: dict(rig)}
        self._written_metadata: dict[str, dict[str, str]] = {}
        self._sequences = dict.fromkeys(_CHANNELS, 0)
        schemas, channels = schemas_and_channels(calibrations or {})
        self._topics = {channel.id: channel.topic for channel in channels}
        self._index = LogIndex(schemas, channels)
        self._file = AppendFile(path)
        try:
            self._write_opening(records(*schemas, *channels), rig_toml, calibration_json)
        except BaseException as error:
            self._file.discard()
            if isinstance(error, OSError):
                raise storage_error(path, error) from error
            raise
        self._thread = WriteThread(self._file, self._index, self._let_go)
        self._write_first_messages(calibrations or {})

    def __enter__(self) -> "LogWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def write_triplet(
        self, slot: int, tag: TripletTag, *, pulse_time: UtcNs, log_time: UtcNs, encoded: bytes | None = None
    ) -> None:
        """Queue a triplet whose pixels stand in `slot`; takes over the caller's hold on it, whatever happens.

        Args:
            slot: of `buffers`; not to be changed any more.
            tag: what became of the pulse.
            pulse_time: time of the pulse, UTC.
            log_time: when the triplet was ready, UTC.
            encoded: `tag.encode()`, if the caller has it already.

        Raises:
            StorageError: writing has ended; the message says why and what to do.
            ValueError: the tag is too long.
        """
        try:
            self._check()
            pages, plan = self._buffers.layout.complete(
                self._buffers.memory(slot), encoded or tag.encode(), tag.pulse, pulse_time, log_time
            )
        except BaseException:
            self._buffers.release(slot)
            raise
        self._thread.submit_slot(slot, pages, plan)

    def write_tag_only(
        self, tag: TripletTag, *, pulse_time: UtcNs, log_time: UtcNs, encoded: bytes | None = None
    ) -> None:
        """Queue the tag of a pulse for which there are no pixels.

        Raises:
            StorageError: writing has ended; the message says why and what to do.
        """
        self._write_small(TAG_CHANNEL, tag.pulse, encoded or tag.encode(), pulse_time, log_time)

    def write_event(self, level: str, name: str, message: str, time_utc: UtcNs) -> None:
        """Queue an event; in the file within a second.

        Raises:
            StorageError: writing has ended; the message says why and what to do.
            ValueError: `level` is none of `recorder.events.Level`.
        """
        self.write_message(EVENTS.name, Event(time_utc, Level(level), name, message).to_protobuf(), time_utc, time_utc)

    def write_health(self, health: Mapping[str, Any], time_utc: UtcNs) -> None:
        """Queue a health record (anything that JSON can say); in the file within a second.

        Raises:
            StorageError: writing has ended; the message says why and what to do.
        """
        self.write_message(HEALTH.name, json.dumps(health, separators=(",", ":")).encode(), time_utc, time_utc)

    def write_message(self, topic: str, data: bytes, publish_time: UtcNs, log_time: UtcNs) -> None:
        """Queue the data of an event or a health record as they stand in a log.

        Raises:
            StorageError: writing has ended; the message says why and what to do.
            KeyError: it is neither.
        """
        self._sequences[topic] += 1
        self._write_small(_CHANNELS[topic], self._sequences[topic], data, publish_time, log_time)

    def set_metadata(self, name: str, fields: Mapping[str, str]) -> None:
        """A metadata record that is new, or has changed since the log was opened; written when it is closed."""
        self._metadata[name] = dict(fields)

    def statistics(self) -> dict[str, Any]:
        """How writing goes, for health: see `WriteThread.statistics`."""
        return self._thread.statistics()

    def free_bytes(self) -> int:
        """Room left on the disk, in bytes. Only while the log is open."""
        return self._file.free_bytes()

    def close(self) -> LogSummary:
        """Write what waits, the summary section, and make all of it durable; a second call only repeats the result.

        After an error the log is closed all the same if the disk lets us: `summary` says what it holds.

        Raises:
            StorageError: not everything that was handed over is in the file, or the file is not closed.
        """
        if self.summary is None:
            self._thread.stop(CLOSE_TIMEOUT_S)
            error = self._thread.error
            try:
                self._file.finish(self._closing_bytes())
            except OSError as reason:
                error = error or storage_error(self.path, reason)
                self._cut()
            self._file.close()
            self.summary = LogSummary(
                self.path,
                {self._topics[channel]: count for channel, count in self._index.messages.items()},
                self._index.chunks,
                self._file.size,
                self._thread.unwritten,
            )
            if error is not None:
                raise error
        return self.summary

    def abandon(self) -> LogSummary | None:
        """Close after an error that has been reported already; None if not even that was possible."""
        try:
            return self.close()
        except StorageError:
            return self.summary

    def _check(self) -> None:
        if self.summary is not None:
            raise StorageError(f"{self.path}: the log is closed; open another one")
        if self._thread.error is not None:
            raise StorageError(*self._thread.error.args) from self._thread.error.__cause__

    def _write_small(self, channel: int, sequence: int, data: bytes, publish_time: UtcNs, log_time: UtcNs) -> None:
        self._check()
        self._thread.submit_small(*chunk_of_one(channel, sequence, data, publish_time, log_time))

    def _let_go(self, slot: int) -> None:
        self._buffers.release(slot)
        if self._on_released is not None:
            self._on_released(slot)

    def _write_opening(self, declarations: bytes, rig_toml: bytes, calibration_json: bytes | None) -> None:
        """Everything that says what the log is, in one durable write."""
        now = time.time_ns()
        out = MAGIC + records(Header(PROFILE, _library())) + declarations
        out += self._changed_metadata(len(out))
        attachments = [Attachment(now, now, RIG_ATTACHMENT, "application/toml", rig_toml)]
        if calibration_json is not None:
            attachments.append(Attachment(now, now, CALIBRATION_ATTACHMENT, "application/json", calibration_json))
        for attachment in attachments:
            record = records(attachment)
            index = AttachmentIndex(
                len(out), len(record), now, now, len(attachment.data), attachment.name, attachment.media_type
            )
            self._index.add_attachment(index)
            out += record
        with join_pages([out]) as pages:
            self._file.append(pages)
        self._file.sync_entry()

    def _changed_metadata(self, position: int) -> bytes:
        """Metadata records that differ from what the file says, to be written at `position`."""
        out = b""
        for name, fields in self._metadata.items():
            if self._written_metadata.get(name) != fields:
                record = records(Metadata(name, fields))
                self._index.add_metadata(name, position + len(out), len(record))
                self._written_metadata[name] = dict(fields)
                out += record
        return out

    def _write_first_messages(self, calibrations: Mapping[str, bytes]) -> None:
        now = UtcNs(time.time_ns())
        for channel, data in enumerate(calibrations.values(), FIRST_CALIBRATION_CHANNEL):
            self._write_small(channel, 1, data, now, now)
        if not self._file.direct:
            self.write_event("warning", "recorder", "the file system takes no direct I/O: writing costs more", now)

    def _closing_bytes(self) -> bytes:
        metadata = self._changed_metadata(self._file.size)
        return metadata + self._index.closing_bytes(self._file.size + len(metadata))

    def _cut(self) -> None:
        try:
            self._file.cut()
        except OSError as error:
            raise storage_error(self.path, error) from error


def _library() -> str:
    return f"svev {importlib.metadata.version('svev')}"
