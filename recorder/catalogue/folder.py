"""The recordings of a folder and its trash: lists and reads them, changes session fields, deletes and restores.

Deleted recordings wait in the subfolder `.trash` until they are restored, or removed for good: when somebody empties
it, when they are old, or when the disk needs their room.
"""

import os
import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from recorder.catalogue.entry import SUFFIX, Entry
from recorder.catalogue.image_places import ImagePlaces
from recorder.catalogue.log_index import Judge, LogIndex, NoJudge
from recorder.catalogue.trash import (
    TrashContents,
    TrashedLog,
    beside,
    oldest_until,
    remove_for_good,
    trash_contents,
    trash_of,
    trashed_logs,
)
from recorder.catalogue.voice_notes import StoredVoice, add_voice_note, check_voice, voice_notes
from recorder.log.session_changes import session_changes, write_session_changes
from recorder.log.write_lock import is_being_written
from recorder.reading.parts import RecordingReader, parts_of
from recorder.reading.records import FileWindow
from recorder.reading.triplets import stored_image, tags
from rig.api.athletes import JumpQuery
from rig.api.recordings import RecordingQuery
from rig.errors import LogDamagedError, StillRecordingError, StorageError, UnknownRecordingError
from rig.host.disk import sync
from rig.host.file_names import ID_BYTES_MAX, give_name, is_recording_id
from rig.host.files import make_folder, opened_folder
from rig.images.picture import shown
from rig.phrase import phrase
from rig.pulse import PulseNumber
from rig.tag import TripletTag

_STEM_MAX: Final = 90
_NUMBER_MAX: Final = 10


@dataclass(frozen=True, slots=True)
class Found:
    """What a query finds.

    Attributes:
        total: how many recordings fit, on all pages.
        entries: those of the page that was asked for, in its order.
    """

    total: int
    entries: Sequence[Entry]


class Catalogue:
    """All recordings of a folder, those in its trash included. Methods may be called from any thread.

    The id of a recording is the name of its file without `.mcap`. Everything of such a name is listed, also what cannot
    be read: its entry says what is wrong.

    Attributes:
        directory: the folder.

    Args:
        directory: the folder.
        judge: knows of a log what is not the recorder's; None: verdicts and measured jumps are not searched for.
    """

    def __init__(self, directory: Path, judge: Judge | None = None) -> None:
        self.directory = directory
        self._trash = trash_of(directory)
        self._logs, self._places = LogIndex(directory, judge or NoJudge()), ImagePlaces()
        self._changing = threading.Lock()

    def end_reading(self) -> None:
        """Read no more logs that are new: the program ends."""
        self._logs.end_reading()

    def close(self) -> None:
        """Close the catalogue's file."""
        self._logs.close()

    def entries(self, *, deleted: bool = False) -> list[Entry]:
        """The recordings, newest first; those in the trash if `deleted`.

        Raises:
            StorageError: the folder cannot be read.
        """
        return list(self.find(RecordingQuery(deleted=deleted)).entries)

    def find(self, query: RecordingQuery) -> Found:
        """The recordings that a query finds.

        Raises:
            BadInputError: its text cannot be understood.
            StorageError: the folder cannot be read.
        """
        with self._reading(self._folder(deleted=query.deleted)):
            if query.deleted:
                self._check_trash()
            return Found(*self._logs.find(query))
        return Found(0, ())

    def jumps(self, query: JumpQuery, columns: str) -> Sequence[tuple[Any, ...]]:
        """Columns, in SQL, of the measured jumps that a query finds, newest first; none that lies in the trash.

        Raises:
            BadInputError: its text cannot be understood.
            StorageError: the folder cannot be read.
        """
        with self._reading(self.directory):
            return self._logs.jumps(query, columns)
        return ()

    def following(self, ids: Sequence[str], *, deleted: bool = False) -> Mapping[str, str]:
        """Which recordings go on with which of these: ids by ids.

        Raises:
            StorageError: the folder cannot be read.
        """
        with self._reading(self._folder(deleted=deleted)):
            return self._logs.following(ids, deleted=deleted)
        return {}

    def entry(self, recording: str, *, prefer_deleted: bool = False) -> Entry:
        """One recording, in the folder or in its trash; `prefer_deleted`: if both hold the id, that in the trash.

        Raises:
            UnknownRecordingError: no recording has this id.
        """
        path = self._path(recording, prefer_deleted=prefer_deleted)
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
        FileWindow(path, direct=False, links=False).close()
        return path

    def first_part(self, recording: str) -> str:
        """Id of the first part of the recording to which a log belongs; its own, if that is not split.

        Raises:
            UnknownRecordingError: no log has this id.
        """
        return parts_of(self._path(recording))[0].stem

    def tags(self, recording: str) -> tuple[TripletTag, ...]:
        """The tags of a recording, in the order of the log, without those in damaged parts.

        Raises:
            UnknownRecordingError: no recording has this id.
            BadInputError: the log cannot be read.
        """
        return tuple(tags(self._path(recording), links=False))

    def image(self, recording: str, pulse: int) -> NDArray[np.uint8]:
        """The image of one pulse, to look at, a copy: (rows, columns), uint8, of a mosaic (rows, columns, 3).

        Reads no other image.

        Raises:
            UnknownRecordingError: there is no such recording, no such pulse in it, or no camera delivered a frame.
            BadInputError: the log cannot be read.
            LogDamagedError: the image is damaged.
        """
        path = self._path(recording)
        with RecordingReader(path, skim=True, links=False) as reader:
            place = self._places.of(reader, pulse).get(PulseNumber(pulse))
            if place is None:
                raise UnknownRecordingError(
                    phrase(
                        "pulse_no_image",
                        "recording {recording} has no image of pulse {pulse}: choose another pulse",
                        recording=recording,
                        pulse=pulse,
                    )
                )
            try:
                stored, pixels = stored_image(reader, pulse, *place)
                return np.array(shown(stored, pixels, coloured=True))
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

    def voice_notes(self, recording: str) -> list[StoredVoice]:
        """The spoken notes of a recording, in the order in which they were spoken.

        Raises:
            UnknownRecordingError: no recording has this id.
            StorageError: the disk refuses.
        """
        with self._change():
            return voice_notes(self._path(recording))

    def add_voice_note(self, recording: str, pulse: int, data: bytes) -> None:
        """Store a spoken note, a WebM file, beside the log of a recording.

        Raises:
            UnknownRecordingError: no recording has this id.
            BadInputError: it is no WebM file.
            StorageError: the disk refuses.
        """
        check_voice(data)
        with self._change():
            add_voice_note(self._path(recording), pulse, data)

    def remove_voice_note(self, recording: str, number: int) -> None:
        """Remove a spoken note for good; if there is none of this number, nothing changes.

        Raises:
            UnknownRecordingError: no recording has this id.
            StorageError: the disk refuses.
        """
        with self._change():
            for note in voice_notes(self._path(recording)):
                if note.number == number:
                    note.path.unlink(missing_ok=True)

    def delete(self, recording: str) -> Entry:
        """Move a recording into the trash. If the trash holds one of that id already, the id gets a number.

        Raises:
            UnknownRecordingError: no recording has this id.
            StillRecordingError: a program is writing it.
            StorageError: the disk refuses.
        """
        with self._change():
            path = self._path(recording)
            if is_being_written(path):
                raise StillRecordingError(
                    phrase(
                        "recording_being_written",
                        "recording {recording} is still being written: stop it first",
                        recording=recording,
                    )
                )
            if path.parent != self._trash:
                make_folder(self._trash)
                log, path = path, self._free_path(path, self._trash)
                give_name(log, path)  # after a crash here the files beside it are where `restore` leaves them
                _move_beside(log, path)
                self._keep_names()
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
                give_name(log, path)
                self._keep_names()
        return self.entry(path.stem)

    def trash(self) -> TrashContents:
        """How much lies in the trash."""
        return trash_contents(self.directory)

    def remove(self, recording: str) -> TrashContents:
        """Remove a recording of the trash for good.

        Returns:
            What was removed.

        Raises:
            UnknownRecordingError: the trash holds no recording of this id; a folder is none.
            StorageError: the disk refuses.
        """
        with self._change():
            logs = [log for log in trashed_logs(self.directory) if log.path.stem == recording]
            if not logs:
                text = f"no recording {recording[:100]!r} in the trash: only what was deleted can be removed for good"
                raise UnknownRecordingError(text)
            return _remove(logs)

    def purge(self, *, older_than_s: float = 0.0, most: int | None = None) -> TrashContents:
        """Remove for good what has been in the trash for more than `older_than_s`; folders stay there.

        Args:
            older_than_s: so long, by the computer's clock.
            most: no more recordings than so many, those that were deleted first; None: all.

        Returns:
            What was removed.

        Raises:
            StorageError: the disk refuses.
        """
        with self._change():
            before = time.time() - older_than_s
            return _remove([log for log in trashed_logs(self.directory) if log.since <= before][:most])

    def make_room(self, wanted_bytes: float, *, older_than_s: float = 0.0) -> TrashContents:
        """Remove for good what has been in the trash for longest, until so much room is won or nothing is left to go.

        Args:
            wanted_bytes: so much room.
            older_than_s: what has not been in the trash for so long stays there.

        Returns:
            What was removed.

        Raises:
            StorageError: the disk refuses.
        """
        with self._change():
            before = time.time() - older_than_s
            logs = [log for log in trashed_logs(self.directory) if log.since <= before]
            return _remove(oldest_until(logs, wanted_bytes))

    def _keep_names(self) -> None:
        """Have the disk take which files lie in the folder, and which in its trash."""
        for folder in (self._trash, self.directory):
            sync(folder)

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

    @contextmanager
    def _reading(self, folder: Path) -> Iterator[None]:
        """Make a StorageError of a folder that cannot be read; one that is not there holds nothing."""
        try:
            yield
        except FileNotFoundError:
            return
        except OSError as error:
            raise StorageError(
                f"{folder}: cannot be read ({error.strerror}); check the folder's permissions"
            ) from error

    def _folder(self, *, deleted: bool) -> Path:
        return self._trash if deleted else self.directory

    def _check_trash(self) -> None:
        """Check that the trash is no link.

        Raises:
            OSError: it is one, or it is not there.
        """
        with opened_folder(self._trash):
            return

    def _path(self, recording: str, *, prefer_deleted: bool = False) -> Path:
        """The log of a recording, looked for in the folder first or, if `prefer_deleted`, in the trash first."""
        if is_recording_id(recording):
            for deleted in (prefer_deleted, not prefer_deleted):
                if deleted and self._trash.is_symlink():  # whatever it leads to does not lie in this folder
                    continue
                path = self._folder(deleted=deleted) / f"{recording}{SUFFIX}"
                if os.path.lexists(path):
                    return path
        raise _unknown(recording)

    def _entry(self, path: Path) -> Entry | None:
        """The entry of a file, None if the file has just been removed."""
        try:
            return self._logs.whole(path)
        except FileNotFoundError:
            return None

    def _free_path(self, log: Path, target: Path) -> Path:
        """A path in `target` with the log's name or, if that is taken, the first number free in folder and trash."""
        name, numbers = log.name, count(2)
        if os.path.lexists(target / name):
            while os.path.lexists(self.directory / name) or os.path.lexists(self._trash / name):
                name = f"{_cut(log.stem)}-{next(numbers)}{SUFFIX}"
        return target / name


def _remove(logs: Iterable[TrashedLog]) -> TrashContents:
    """Remove logs for good, but none that a program is writing: it was moved into the trash by another one."""
    logs = [log for log in logs if not is_being_written(log.path)]
    for log in logs:
        remove_for_good(log)
    return TrashContents(len(logs), sum(log.bytes for log in logs))


def _cut(stem: str) -> str:
    """As much of an id as leaves room for a number behind it."""
    stem = stem[:_STEM_MAX]
    while len(os.fsencode(stem)) > ID_BYTES_MAX - _NUMBER_MAX:
        stem = stem[:-1]
    return stem


def _move_beside(log: Path, target: Path) -> None:
    for before, after in zip(beside(log), beside(target), strict=True):
        if os.path.lexists(before):
            before.rename(after)


def _unknown(recording: str) -> UnknownRecordingError:
    return UnknownRecordingError(f"no recording {recording[:100]!r}: see the list of recordings")
