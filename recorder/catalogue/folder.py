"""The recordings of a folder and its trash: lists and reads them, changes session fields, deletes and restores.

Deleted recordings wait in the subfolder `.trash` until they are restored, or old enough to be removed for good.
"""

import os
import re
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from stat import S_ISDIR
from typing import Final

import numpy as np
from numpy.typing import NDArray

from recorder.catalogue.entry import Entry, with_changes
from recorder.catalogue.log_cache import LogCache
from recorder.log.session_changes import session_changes, session_path, write_session_changes
from recorder.log.truth_path import truth_path
from recorder.reading.log_reader import LogReader
from recorder.reading.records import FileWindow
from recorder.reading.triplets import stored_image, tags
from rig.errors import LogDamagedError, StorageError, UnknownRecordingError
from rig.pulse import PulseNumber
from rig.tag import TripletTag

_SUFFIX: Final = ".mcap"
_TRASH: Final = ".trash"
_ID: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}", re.ASCII)
_STEM_MAX: Final = 90


class Catalogue:
    """All recordings of a folder, those in its trash included. Methods may be called from any thread.

    The id of a recording is the name of its file without `.mcap`. Everything of such a name is listed, also what cannot
    be read: its entry says what is wrong.

    Attributes:
        directory: the folder.
    """

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self._trash = directory / _TRASH
        self._logs = LogCache(directory)
        self._changing = threading.Lock()

    def entries(self, *, deleted: bool = False) -> list[Entry]:
        """The recordings, newest first; those in the trash if `deleted`.

        Raises:
            StorageError: the folder cannot be read.
        """
        folder = self._folder(deleted=deleted)
        try:
            paths = [path for path in folder.iterdir() if path.suffix == _SUFFIX and _ID.fullmatch(path.stem)]
        except FileNotFoundError:
            return []
        except OSError as error:
            raise StorageError(
                f"{folder}: cannot be read ({error.strerror}); check the folder's permissions"
            ) from error
        found = [entry for path in paths if (entry := self._entry(path)) is not None]
        self._logs.save()
        return sorted(found, key=lambda entry: (entry.started or entry.modified, entry.id), reverse=True)

    def entry(self, recording: str) -> Entry:
        """One recording, in the folder or in its trash.

        Raises:
            UnknownRecordingError: no recording has this id.
        """
        path = self._path(recording)
        entry = self._entry(path)
        if entry is None:
            raise _unknown(recording)
        return entry

    def file(self, recording: str) -> Path:
        """The log of a recording, to be read as a file.

        Raises:
            UnknownRecordingError: no recording has this id.
            BadInputError: it may not be read, or is no regular file.
        """
        path = self._path(recording)
        FileWindow(path, direct=False).close()
        return path

    def tags(self, recording: str) -> tuple[TripletTag, ...]:
        """The tags of a recording, in the order of the log, without those in damaged parts.

        Raises:
            UnknownRecordingError: no recording has this id.
            BadInputError: the log cannot be read.
        """
        return tuple(tags(self._path(recording)))

    def image(self, recording: str, pulse: int) -> NDArray[np.uint8]:
        """The image of one pulse, (rows, columns), uint8, a copy. Reads no other image.

        Raises:
            UnknownRecordingError: there is no such recording, no such pulse in it, or no camera delivered a frame.
            BadInputError: the log cannot be read.
            LogDamagedError: the image is damaged.
        """
        path = self._path(recording)
        place = self._logs.image_places(path, pulse).get(PulseNumber(pulse))
        if place is None:
            raise UnknownRecordingError(f"recording {recording} has no image of pulse {pulse}: choose another pulse")
        with LogReader(path, skim=True) as reader:
            try:
                return stored_image(reader, pulse, *place).copy()
            except ValueError as error:
                raise LogDamagedError(
                    f"{path}: the image of pulse {pulse} is damaged ({error}); see the others with `svev verify`"
                ) from None

    def change_session(self, recording: str, changes: Mapping[str, str]) -> Entry:
        """Set some fields of a recording's session, in a file beside the log; the log stays as it is.

        Raises:
            UnknownRecordingError: no recording has this id.
            BadInputError: earlier changes cannot be read.
            StorageError: the disk refuses.
        """
        with self._change():
            path = self._path(recording)
            write_session_changes(path, {**session_changes(path), **changes})
        return self.entry(recording)

    def delete(self, recording: str) -> Entry:
        """Move a recording into the trash. If the trash holds one of that id already, the id gets a number.

        Raises:
            UnknownRecordingError: no recording has this id.
            StorageError: the disk refuses.
        """
        with self._change():
            path = self._path(recording)
            if path.parent != self._trash:
                self._trash.mkdir(exist_ok=True)
                log, path = path, self._free_path(path, self._trash)
                log.rename(path)  # after a crash here the files beside it are where `restore` leaves them
                _move_beside(log, path)
        return self.entry(path.stem)

    def restore(self, recording: str) -> Entry:
        """Move a recording out of the trash. If the folder holds one of that id by now, the id gets a number.

        Raises:
            UnknownRecordingError: no recording has this id.
            StorageError: the disk refuses.
        """
        with self._change():
            path = self._path(recording, prefer_deleted=True)
            if path.parent == self._trash:
                log, path = path, self._free_path(path, self.directory)
                _move_beside(log, path)
                log.rename(path)
        return self.entry(path.stem)

    def purge(self, older_than_s: float) -> list[str]:
        """Remove for good what has been in the trash for more than `older_than_s`; folders stay there.

        Returns:
            The ids.

        Raises:
            StorageError: the disk refuses.
        """
        gone = []
        with self._change():
            for log in self._trash.glob(f"*{_SUFFIX}"):
                # Nobody writes into a deleted log, so its inode changed last when it was moved here.
                stat = log.lstat()
                if not S_ISDIR(stat.st_mode) and stat.st_ctime <= time.time() - older_than_s:
                    log.unlink()
                    for beside in _beside(log):
                        beside.unlink(missing_ok=True)
                    gone.append(log.stem)
        return gone

    @contextmanager
    def _change(self) -> Iterator[None]:
        """Let one thread at a time change the folder, and make a StorageError of what the disk refuses."""
        with self._changing:
            try:
                yield
            except OSError as error:
                raise StorageError(
                    f"{error.filename or self.directory}: cannot be changed ({error.strerror}); check the folder's "
                    "permissions and the room on its disk"
                ) from error

    def _folder(self, *, deleted: bool) -> Path:
        return self._trash if deleted else self.directory

    def _path(self, recording: str, *, prefer_deleted: bool = False) -> Path:
        """The log of a recording, looked for in the folder first or, if `prefer_deleted`, in the trash first."""
        if _ID.fullmatch(recording):
            for deleted in (prefer_deleted, not prefer_deleted):
                path = self._folder(deleted=deleted) / f"{recording}{_SUFFIX}"
                if os.path.lexists(path):
                    return path
        raise _unknown(recording)

    def _entry(self, path: Path) -> Entry | None:
        """The entry of a file, None if the file has just been removed."""
        try:
            entry = self._logs.entry(path)
        except FileNotFoundError:
            return None
        return with_changes(entry, path, deleted=path.parent == self._trash)

    def _free_path(self, log: Path, target: Path) -> Path:
        """A path in `target` with the log's name or, if that is taken, the first number free in folder and trash."""
        name, numbers = log.name, count(2)
        if os.path.lexists(target / name):
            while os.path.lexists(self.directory / name) or os.path.lexists(self._trash / name):
                name = f"{log.stem[:_STEM_MAX]}-{next(numbers)}{_SUFFIX}"
        return target / name


def _beside(log: Path) -> tuple[Path, ...]:
    """The files that belong to a log, whether they are there or not."""
    return session_path(log), truth_path(log)


def _move_beside(log: Path, target: Path) -> None:
    for before, after in zip(_beside(log), _beside(target), strict=True):
        if before.exists():
            before.rename(after)


def _unknown(recording: str) -> UnknownRecordingError:
    return UnknownRecordingError(f"no recording {recording[:100]!r}: see the list of recordings")
