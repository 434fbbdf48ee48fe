"""Reads the logs that are merged: first what they say of themselves and their pulses, then everything, in order."""

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Self

import numpy as np

from recorder.log.channels import CALIBRATION_TOPIC
from recorder.log.extent import times_of
from recorder.reading.info import LogInfo, info
from recorder.reading.items import Chunk, Message
from recorder.reading.log_reader import LogReader
from recorder.reading.records import Damage
from recorder.reading.triplets import images_of, read_tag, tag_of
from recorder.recovering.scan import picture_of
from rig.clocks import NS_PER_US, UtcNs
from rig.errors import BadInputError, LogDamagedError
from rig.frame import FrameStatus
from rig.images.pixels import Stored
from rig.tag import TripletTag
from rig.topics import NOTES, TAG
from triggering.alignment import Train


@dataclass(frozen=True, slots=True)
class Part:
    """One of the logs.

    Attributes:
        about: what it says of itself.
        first: its first tag; all others name the same cameras.
        train: its pulses.
        begin, end: of the recording, UTC, as the log says; None: it does not.
        metadata: its metadata records.
        own_topics: each of its cameras has a topic of its own.
    """

    about: LogInfo
    first: TripletTag
    train: Train
    begin: UtcNs | None
    end: UtcNs | None
    metadata: dict[str, dict[str, str]]
    own_topics: bool

    @property
    def path(self) -> Path:
        """The log."""
        return self.about.path


def look_at(path: Path) -> Part:
    """Read the tags of a log.

    Raises:
        BadInputError: no such file, no log of ours, or no pulse in it.
        LogDamagedError: it was not closed, is damaged, or lacks tags.
    """
    about = info(path)
    if about.being_written:
        raise LogDamagedError(f"{path}: is still being written; merge it when the recording has ended")
    if not about.closed or about.damaged_bytes:
        raise LogDamagedError(
            f"{path}: was not closed, or is damaged: make a whole log of it with `svev recover`, and merge that one"
        )
    if about.missing_pulses or about.ledger.out_of_order:
        raise LogDamagedError(f"{path}: has pulses without a tag, or out of order: only whole logs are merged")
    if about.first is None:
        raise BadInputError(f"{path}: has no pulse: nothing can be merged; name another log")
    times, seen = [], []
    with LogReader(path, skim=True) as reader:
        for chunk in reader.sound_chunks(only=(TAG.name,)):
            for message in chunk.messages:
                if (tag := tag_of(message)) is not None:
                    _check_cameras(path, about.first, tag)
                    times.append(tag.time)
                    seen.append(any(camera.status is FrameStatus.OK for camera in tag.cameras))
        if any(later <= time for time, later in pairwise(times)):
            raise LogDamagedError(f"{path}: a pulse is not later than the one before it; look at `svev verify`")
        begin, end = times_of(reader.metadata)
        metadata, own_topics = dict(reader.metadata), reader.has_camera_topics
    utc = about.utc
    train = Train(
        np.array(times, np.int64),
        np.array(seen),
        min(times[0], begin or times[0]),
        max(times[-1], end or times[-1]),
        None if utc is None or not utc.synchronized else utc.at_most_us * NS_PER_US,
    )
    return Part(about, about.first, train, begin, end, metadata, own_topics)


def _check_cameras(path: Path, first: TripletTag, tag: TripletTag) -> None:
    known, found = ([(each.name, each.columns, each.rows) for each in one.cameras] for one in (first, tag))
    if (known, first.shape, first.dtype) != (found, tag.shape, tag.dtype):
        raise LogDamagedError(f"{path}: pulse {tag.pulse} is of other cameras than the first; look at `svev verify`")


@dataclass(frozen=True, slots=True)
class Note:
    """A message of the recorder that belongs to no pulse."""

    topic: str
    data: bytes
    publish_time: UtcNs
    log_time: UtcNs


@dataclass(frozen=True, slots=True)
class Pulse:
    """A pulse of a log.

    Attributes:
        tag: what became of it.
        picture: its pixels, (rows, columns), valid until the next pulse is taken; None: there are none.
        ready: when it was ready, UTC.
    """

    tag: TripletTag
    picture: Stored | None
    ready: UtcNs


class LogStream:
    """Everything in a log, in its order and checked; a context manager.

    Attributes:
        calibrations: serialized `foxglove.CameraCalibration` by camera name.
        attachments: contents by name.
    """

    def __init__(self, path: Path) -> None:
        """Open the log and read up to its first pulse.

        Raises:
            BadInputError: the log cannot be read.
            LogDamagedError: it is damaged.
        """
        self._path = path
        self.calibrations: dict[str, bytes] = {}
        self._early: list[Note] = []
        self._held: Pulse | None = None
        self._reader = LogReader(path)
        self._contents = self._read()
        try:
            for found in self._contents:
                if isinstance(found, Pulse):
                    self._held = found
                    break
                self._early.append(found)
        except BaseException:
            self._reader.close()
            raise
        self.attachments = self._reader.attachments

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._contents.close()
        self._reader.close()

    def take(self, time: int, note: Callable[[Note], None]) -> Pulse:
        """The next pulse.

        Args:
            time: of the pulse, as the first reading has found it.
            note: called with the notes that stand before it.

        Raises:
            LogDamagedError: the log is damaged, or was changed since.
        """
        found, self._held = self._held, None
        if found is None:
            found = next((each for each in self._passing(note) if isinstance(each, Pulse)), None)
        else:
            for early in self._early:
                note(early)
        if found is None or found.tag.time != time:
            raise LogDamagedError(f"{self._path}: was changed while it was read; merge it when nobody writes it")
        return found

    def finish(self, note: Callable[[Note], None]) -> None:
        """Read what stands after the last pulse."""
        for _ in self._passing(note):
            pass

    def _passing(self, note: Callable[[Note], None]) -> Iterator[Pulse]:
        for found in self._contents:
            if isinstance(found, Pulse):
                yield found
            else:
                note(found)

    def _read(self) -> Generator[Note | Pulse, None, None]:
        for item in self._reader.items():
            if isinstance(item, Damage) or (isinstance(item, Chunk) and item.flaw):
                what = item.text if isinstance(item, Damage) else item.flaw
                raise LogDamagedError(
                    f"{self._path}: {what}, at byte {item.offset}: make a whole log of it with `svev recover`, and "
                    "merge that one"
                )
            if not isinstance(item, Chunk):
                continue
            images = images_of(item)
            for message in item.messages:
                if message.topic == TAG.name:
                    yield self._pulse(message, images.get(message.sequence))
                elif message.topic in NOTES:
                    yield Note(message.topic, bytes(message.data or b""), message.publish_time, message.log_time)
                elif message.topic.startswith(CALIBRATION_TOPIC):
                    camera = message.topic.removeprefix(CALIBRATION_TOPIC)
                    self.calibrations.setdefault(camera, bytes(message.data or b""))

    def _pulse(self, message: Message, image: Message | None) -> Pulse:
        try:
            tag = read_tag(bytes(message.data or b""))
        except ValueError as error:
            raise LogDamagedError(
                f"{self._path}: the tag of pulse {message.sequence} cannot be read: {error}"
            ) from None
        picture = None if image is None else picture_of(image, tag)
        if picture is None and any(camera.status is FrameStatus.OK for camera in tag.cameras):
            raise LogDamagedError(
                f"{self._path}: pulse {tag.pulse}: its tag says that frames came, but there is no image: make a whole "
                "log of it with `svev recover`, and merge that one"
            )
        return Pulse(tag, picture, message.log_time)
