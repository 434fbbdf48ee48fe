"""The recordings of a folder: what there is and what is in it; change session fields, delete, restore."""

import re
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from recorder.activity import liveliest, stored_triplets
from recorder.catalogue_entry import Entry, LogState, read_entry, with_changes
from recorder.log_items import Chunk
from recorder.log_reader import ForeignFileError, LogReader, tag_of
from recorder.raw_image import pixels, view_image
from recorder.session_changes import session_changes, write_session_changes
from recorder.trash import SUFFIX, Trash
from rig.errors import LogDamagedError, StorageError, SvevError
from rig.frame import FrameStatus
from rig.tag import TripletTag
from rig.topics import TAG

_ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}", re.ASCII)
#: A log that grows is looked at again when this many times has passed what the last look took.
_PATIENCE: Final = 10
#: So many logs' places of images are kept.
_PLACES_MAX: Final = 4
#: So many images are looked at, twice, to find the one that stands for a recording: a flight lasts some tenths of it.
_SAMPLES: Final = 24

_FileKey = tuple[int, int, int]


class UnknownRecordingError(SvevError):
    """There is no such recording, or no such pulse in it."""


@dataclass(frozen=True, slots=True)
class _Seen:
    """What a look at a file gave; entry None: it is no log of svev. `fresh_until`: on `time.monotonic`, s."""

    key: _FileKey
    entry: Entry | None
    fresh_until: float


@dataclass(frozen=True, slots=True)
class _Places:
    """Where the images of a log stand in it: offset and length by pulse; `key` as of when this was found out."""

    key: _FileKey
    by_pulse: Mapping[int, tuple[int, int]]


class Catalogue:
    """All recordings of a folder, those in its trash included. Methods may be called from any thread.

    The id of a recording is the name of its file without `.mcap`. Files with other names, and files that are no logs
    of svev, are passed over. What a look at a log gave is kept until the file changes.

    Attributes:
        directory: the folder.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self._trash = Trash(directory)
        self._seen: dict[Path, _Seen] = {}
        self._places: dict[Path, _Places] = {}
        self._reading, self._changing = threading.Lock(), threading.Lock()

    def entries(self, *, deleted: bool = False) -> list[Entry]:
        """The recordings, newest first; those in the trash if `deleted`."""
        found = []
        for path in self._folder(deleted=deleted).glob(f"*{SUFFIX}"):
            if _ID.fullmatch(path.stem) and path.is_file() and (entry := self._entry(path)) is not None:
                found.append(entry)
        return sorted(found, key=lambda entry: (entry.started or entry.modified, entry.id), reverse=True)

    def entry(self, recording: str) -> Entry:
        """One recording, in the trash or not.

        Raises:
            UnknownRecordingError: there is none of this id.
        """
        path = self._path(recording)
        entry = self._entry(path)
        if entry is None:
            raise _unknown(recording)
        return entry

    def tags(self, recording: str) -> tuple[TripletTag, ...]:
        """The tags of a recording, in the order of the log, those in damaged parts left out.

        Raises:
            UnknownRecordingError: there is none of this id.
            BadInputError: it cannot be read.
        """
        with LogReader(self._path(recording), skim=True) as reader:
            return tuple(
                tag
                for item in reader.items(only=(TAG.name,))
                if isinstance(item, Chunk) and not item.flaw
                for message in item.messages
                if (tag := tag_of(message)) is not None
            )

    def image(self, recording: str, pulse: int) -> NDArray[np.uint8]:
        """One triplet, (rows, columns); a copy of its own. Reads nothing else, once it is known where images stand.

        Raises:
            UnknownRecordingError: there is no such recording, no such pulse in it, or no camera delivered a frame.
            BadInputError: it cannot be read.
            LogDamagedError: its image is damaged.
        """
        path = self._path(recording)
        place = self._places_of(path, pulse).get(pulse)
        if place is None:
            raise UnknownRecordingError(f"recording {recording} has no image of pulse {pulse}: choose another pulse")
        with LogReader(path, skim=True) as reader:
            try:
                return pixels(view_image(reader.read(*place))).copy()
            except ValueError as error:
                raise LogDamagedError(
                    f"{path}: the image of pulse {pulse} is damaged ({error}); see the others with `svev verify`"
                ) from None

    def liveliest_pulse(self, recording: str) -> int:
        """The pulse that shows best what a recording is: amid the stretch in which most moves, complete if any is.

        Raises:
            UnknownRecordingError: there is no such recording, or no camera delivered a frame.
            BadInputError: it cannot be read.
            LogDamagedError: one of the images that were looked at is damaged.
        """
        path = self._path(recording)
        with LogReader(path, skim=True) as reader:
            stored = stored_triplets(reader)
            shown = [triplet for triplet in stored if triplet.tag.complete] or [
                triplet for triplet in stored if any(camera.status is FrameStatus.OK for camera in triplet.tag.cameras)
            ]
            if not shown:
                raise UnknownRecordingError(f"recording {recording} has no image: no camera delivered one")
            try:
                return liveliest(reader, shown, 3, _SAMPLES)[len(shown[:3]) // 2].tag.pulse
            except ValueError as error:
                raise LogDamagedError(f"{path}: an image is damaged ({error}); see which with `svev verify`") from None

    def change_session(self, recording: str, changes: Mapping[str, str]) -> Entry:
        """Set some fields of a recording's session; beside the log, which stays as it is.

        Raises:
            UnknownRecordingError: there is none of this id.
            BadInputError: earlier changes cannot be read.
            StorageError: the disk refuses.
        """
        with self._change():
            path = self._path(recording)
            write_session_changes(path, {**session_changes(path), **changes})
        return self.entry(recording)

    def delete(self, recording: str) -> Entry:
        """Put a recording into the trash. If one of that id is there already, its id gets a number.

        Raises:
            UnknownRecordingError: there is none of this id.
            StorageError: the disk refuses.
        """
        with self._change():
            path = self._path(recording)
            if path.parent != self._trash.path:
                path = self._trash.put(path)
        return self.entry(path.stem)

    def restore(self, recording: str) -> Entry:
        """Take a recording out of the trash. If one of that id has come since, its id gets a number.

        Raises:
            UnknownRecordingError: there is none of this id.
            StorageError: the disk refuses.
        """
        with self._change():
            path = self._path(recording, prefer_deleted=True)
            if path.parent == self._trash.path:
                path = self._trash.restore(path)
        return self.entry(path.stem)

    def purge(self, older_than_s: float) -> list[str]:
        """Remove for good what has been in the trash for longer than this.

        Returns:
            The ids.

        Raises:
            StorageError: the disk refuses.
        """
        with self._change():
            return self._trash.purge(older_than_s)

    @contextmanager
    def _change(self) -> Iterator[None]:
        """One change of the folder at a time; what the disk says against it, in words."""
        with self._changing:
            try:
                yield
            except OSError as error:
                raise StorageError(
                    f"{error.filename or self.directory}: cannot be changed ({error.strerror}); check the folder's "
                    "permissions and the room on its disk"
                ) from error

    def _folder(self, *, deleted: bool) -> Path:
        return self._trash.path if deleted else self.directory

    def _path(self, recording: str, *, prefer_deleted: bool = False) -> Path:
        """The log of a recording; the folder first or, if wished, the trash."""
        if _ID.fullmatch(recording):
            for deleted in (prefer_deleted, not prefer_deleted):
                path = self._folder(deleted=deleted) / f"{recording}{SUFFIX}"
                if path.is_file():
                    return path
        raise _unknown(recording)

    def _entry(self, path: Path) -> Entry | None:
        """The entry of a file, None if it is no log of svev or has just gone."""
        try:
            entry = self._look(path)
        except FileNotFoundError:
            return None
        return entry and with_changes(entry, path, deleted=path.parent == self._trash.path)

    def _look(self, path: Path) -> Entry | None:
        with self._reading:
            key, seen = _file_key(path), self._seen.get(path)
            if seen is not None and (seen.key == key or self._still_growing(path, seen)):
                return seen.entry
            began = time.monotonic()
            try:
                entry = read_entry(path)
            except ForeignFileError:
                entry = None
            now = time.monotonic()
            self._seen[path] = _Seen(key, entry, now + _PATIENCE * (now - began))
            return entry

    @staticmethod
    def _still_growing(path: Path, seen: _Seen) -> bool:
        """Whether a log that is being written was looked at only just now."""
        if seen.entry is None or seen.entry.state is not LogState.UNFINISHED or time.monotonic() > seen.fresh_until:
            return False
        if seen.key[0] != _file_key(path)[0]:
            return False
        with LogReader(path, skim=True) as reader:
            return not reader.closed

    def _places_of(self, path: Path, pulse: int) -> Mapping[int, tuple[int, int]]:
        """Where images stand; what was found out before is still true of a log that has only grown."""
        with self._reading:
            key, known = _file_key(path), self._places.pop(path, None)
            if known is None or (known.key != key and (known.key[0] != key[0] or pulse not in known.by_pulse)):
                with LogReader(path, skim=True) as reader:
                    by_pulse = {stored.tag.pulse: (stored.offset, stored.length) for stored in stored_triplets(reader)}
                known = _Places(key, by_pulse)
            self._places[path] = known  # the newest stands last
            if len(self._places) > _PLACES_MAX:
                del self._places[next(iter(self._places))]
            return known.by_pulse


def _file_key(path: Path) -> _FileKey:
    """What changes when a file does: which one it is, its size, when it was written."""
    stat = path.stat()
    return stat.st_ino, stat.st_size, stat.st_mtime_ns


def _unknown(recording: str) -> UnknownRecordingError:
    return UnknownRecordingError(f"no recording {recording[:100]!r}: see the list of recordings")
