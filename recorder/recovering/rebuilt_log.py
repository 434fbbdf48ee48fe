"""The log that `recover` writes: created when the first pulse is known, removed again if recovery fails."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from recorder.log.channels import CALIBRATION_TOPIC
from recorder.log.triplet_buffers import TripletBuffers
from recorder.reading.log_reader import LogReader, Message
from recorder.writing.log_writer import LogDescription, LogWriter
from rig.clocks import UtcNs
from rig.errors import StorageError
from rig.events import Event
from rig.tag import TripletTag
from rig.topics import (
    CALIBRATION_ATTACHMENT,
    EVENTS,
    HEALTH,
    RECOVERY_METADATA,
    RIG_ATTACHMENT,
    RIG_METADATA,
    SESSION_METADATA,
)

_SLOTS: Final = 4
_DISK_S: Final = 60.0


class RebuiltLog:
    """A new log with the session, rig and calibration of an old one; a context manager.

    Args:
        path: the new log; must not exist.
        old: the old log, which the caller reads meanwhile.
        changes: session fields that were changed after the recording.
    """

    def __init__(self, path: Path, old: LogReader, changes: Mapping[str, str]) -> None:
        self._path, self._old, self._changes = path, old, changes
        self._early: list[tuple[str, bytes, UtcNs, UtcNs]] = []
        self._buffers: TripletBuffers | None = None
        self._writer: LogWriter | None = None
        self._closed = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._writer is not None and not self._closed:
            self._writer.abandon()
            self._path.unlink(missing_ok=True)
        if self._buffers is not None:
            self._buffers.close()

    def pulse(self, tag: TripletTag, picture: NDArray[np.uint8] | None, message: Message | None) -> None:
        """Write a pulse.

        Args:
            tag: what became of the pulse.
            picture: its pixels, (rows, columns), uint8; None if there are none.
            message: the message that holds the tag unchanged, None if there is none.

        Raises:
            BadInputError: the new log exists already, or cannot be made.
            StorageError: the disk refuses.
        """
        writer, buffers = self._opened(tag)
        ready = tag.time if message is None else message.log_time
        encoded = None if message is None or message.data is None else bytes(message.data)
        if picture is None:
            writer.write_pulse(tag, None, ready, encoded)
            return
        slot = buffers.acquire(_DISK_S)
        if slot is None:
            raise StorageError(f"{self._path}: the disk has taken nothing for {_DISK_S:g} s; look at `dmesg`")
        np.copyto(buffers.pixels(slot), picture)
        writer.write_pulse(tag, slot, ready, encoded)

    def other(self, message: Message) -> bool:
        """Write an event, a health record or a calibration.

        Returns:
            False if the message is none of them.

        Raises:
            StorageError: the disk refuses.
        """
        if message.topic not in {EVENTS.name, HEALTH.name} and not message.topic.startswith(CALIBRATION_TOPIC):
            return False
        data = bytes(message.data or b"")
        if self._writer is None:
            self._early.append((message.topic, data, message.publish_time, message.log_time))
        else:
            self._writer.write_message(message.topic, data, message.publish_time, message.log_time)
        return True

    def close(self, recovery: Mapping[str, str], event: Event) -> int:
        """Finish the log.

        Args:
            recovery: fields of the metadata record that says where the log comes from and what is lost.
            event: last event of the log.

        Returns:
            Its size in bytes; 0 if no pulse was written, and so no log.

        Raises:
            StorageError: the disk refuses.
        """
        if self._writer is None:
            return 0
        self._writer.write_event(event)
        self._writer.set_metadata(SESSION_METADATA, self._session())  # the old log's last record may have come late
        self._writer.set_metadata(RECOVERY_METADATA, recovery)
        size = self._writer.close().bytes
        self._closed = True
        return size

    def _session(self) -> dict[str, str]:
        return {**self._old.metadata.get(SESSION_METADATA, {}), **self._changes}

    def _opened(self, tag: TripletTag) -> tuple[LogWriter, TripletBuffers]:
        if self._writer is None or self._buffers is None:
            cameras = ", ".join(camera.name for camera in tag.cameras)
            self._buffers = self._buffers or TripletBuffers(tag.shape, _SLOTS)
            attachments = self._old.attachments
            self._writer = LogWriter(
                self._path,
                LogDescription(
                    session=self._session(),
                    rig=self._old.metadata.get(RIG_METADATA, {"cameras": cameras}),
                    rig_toml=attachments.get(RIG_ATTACHMENT, b""),
                    calibration_json=attachments.get(CALIBRATION_ATTACHMENT),
                    calibrations={
                        topic.removeprefix(CALIBRATION_TOPIC): data
                        for topic, data, _, _ in self._early
                        if topic.startswith(CALIBRATION_TOPIC)
                    },
                ),
                self._buffers,
            )
            for topic, data, publish_time, log_time in self._early:
                if not topic.startswith(CALIBRATION_TOPIC):
                    self._writer.write_message(topic, data, publish_time, log_time)
            self._early.clear()
        return self._writer, self._buffers
