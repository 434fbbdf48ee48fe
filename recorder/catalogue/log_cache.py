"""Keeps what was read from the logs of a folder, and from the files of their sessions' changes, until they change."""

import os
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final

from recorder.catalogue.entry import SUFFIX, Entry, LogState, read_entry, with_changes
from recorder.catalogue.index_file import FileKey, KeptEntry, file_key, keep, load_kept
from recorder.log.session_changes import session_name, session_path
from recorder.log.write_lock import is_being_written
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import stored_triplets
from rig.errors import BadInputError
from rig.host.file_names import is_recording_id
from rig.pulse import PulseNumber

#: A growing log is read again when this many times the duration of the last reading has passed.
_PATIENCE: Final = 10
#: The places of the images of so many logs are kept.
_PLACES_MAX: Final = 4


_Look = Callable[[], os.stat_result]


@dataclass(frozen=True, slots=True)
class _Places:
    """Where the images of a log stand: offset and length by pulse; `key`: of the file when it was read."""

    key: FileKey
    by_pulse: Mapping[PulseNumber, tuple[int, int]]


@dataclass(frozen=True, slots=True)
class _Changed:
    """An entry with the changes of its session.

    Attributes:
        plain: the entry without them.
        key: of the file with the changes when it was read; None: there was none.
        entry: with them.
    """

    plain: Entry
    key: FileKey | None
    entry: Entry


class LogCache:
    """What was read from the logs of a folder. Reads one log at a time, whichever thread asks.

    As long as neither the log nor the file of its session's changes changes, its entry is the same object.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._lock = threading.Lock()
        self._read: dict[str, KeptEntry] | None = None  # by path below the directory; None: not yet loaded
        self._changed: dict[str, _Changed] = {}
        self._fresh_until: dict[str, float] = {}  # of growing logs, on `time.monotonic`, s
        self._places: dict[Path, _Places] = {}
        self._unsaved = False

    def entry(self, path: Path) -> Entry:
        """The entry of a file.

        Raises:
            FileNotFoundError: the file is no longer there.
        """
        with self._lock:
            return self._entry(str(path.relative_to(self._directory)), path.lstat, session_path(path).lstat)

    def entries(self, folder: Path) -> list[Entry]:
        """The entries of the logs in the directory or in a folder below it, whatever their order.

        Raises:
            OSError: the folder cannot be read.
        """
        with os.scandir(folder) as found:
            files = {each.name: each for each in found}
        below = "" if folder == self._directory else f"{folder.relative_to(self._directory)}/"
        entries = []
        with self._lock:
            for name, file in files.items():
                if name.endswith(SUFFIX) and is_recording_id(stem := name.removesuffix(SUFFIX)):
                    beside = files.get(session_name(stem))
                    looks = (
                        partial(file.stat, follow_symlinks=False),
                        beside and partial(beside.stat, follow_symlinks=False),
                    )
                    with suppress(FileNotFoundError):  # it has just been removed
                        entries.append(self._entry(below + name, *looks))
        return entries

    def save(self) -> None:
        """Keep the entries for the next service, if there are new ones, without those of files that are gone."""
        with self._lock:
            if self._unsaved and self._read is not None:
                self._read = {name: each for name, each in self._read.items() if (self._directory / name).is_file()}
                self._changed = {name: each for name, each in self._changed.items() if name in self._read}
                keep(self._directory, self._read)
                self._unsaved = False

    def _entry(self, name: str, look: _Look, look_beside: _Look | None) -> Entry:
        """The entry of a file.

        Args:
            name: of the file, with the folder in which it lies below the directory.
            look: asks for its status.
            look_beside: asks for that of the file with the changes of its session; None: there is none.

        Raises:
            FileNotFoundError: the file is no longer there.
        """
        plain = self._plain(name, look)
        if plain.state is LogState.UNFINISHED and is_being_written(self._directory / name):
            plain = replace(plain, state=LogState.WRITING)
        key, deleted = None, "/" in name
        if look_beside is not None:
            with suppress(OSError):
                key = file_key(look_beside())
        if key is None and not deleted:
            return plain
        known = self._changed.get(name)
        if known is None or known.plain is not plain or known.key != key:
            entry = with_changes(plain, self._directory / name, deleted=deleted)
            known = self._changed[name] = _Changed(plain, key, entry)
        return known.entry

    def _plain(self, name: str, look: _Look) -> Entry:
        """The entry of a file without its session's changes."""
        if self._read is None:
            self._read = load_kept(self._directory)
        try:
            key = file_key(look())
        except FileNotFoundError:
            raise
        except OSError:
            return read_entry(self._directory / name)  # it says why, at every look
        known = self._read.get(name)
        if known is not None and (known.key == key or self._still_growing(name, key, known)):
            return known.entry
        began = time.monotonic()
        entry = read_entry(self._directory / name)
        now = time.monotonic()
        self._read[name] = KeptEntry(key, entry)
        self._fresh_until[name] = now + _PATIENCE * (now - began)
        # A growing log is another one at every look: it is saved with others, when it has ended.
        self._unsaved = self._unsaved or entry.state is not LogState.UNFINISHED
        return entry

    def image_places(self, reader: LogReader, pulse: int) -> Mapping[PulseNumber, tuple[int, int]]:
        """Offset and length of an open log's image messages by pulse, that of `pulse` among them if there is one.

        Places in a log that has only grown since it was read are still true.

        Raises:
            BadInputError: the log cannot be read.
        """
        path = reader.path
        with self._lock:
            key, known = file_key(reader.status), self._places.pop(path, None)
            if known is None or (known.key != key and (known.key[0] != key[0] or pulse not in known.by_pulse)):
                by_pulse = {stored.tag.pulse: (stored.offset, stored.length) for stored in stored_triplets(reader)}
                known = _Places(key, by_pulse)
            self._places[path] = known  # the newest stands last
            if len(self._places) > _PLACES_MAX:
                del self._places[next(iter(self._places))]
            return known.by_pulse

    def _still_growing(self, name: str, key: FileKey, known: KeptEntry) -> bool:
        """Whether a log that is being written was read only just now."""
        if known.entry.state is not LogState.UNFINISHED or time.monotonic() > self._fresh_until.get(name, 0.0):
            return False
        if known.key[0] != key[0]:
            return False
        try:
            with LogReader(self._directory / name, skim=True, links=False) as reader:
                return not reader.closed
        except (OSError, BadInputError):
            return False  # then reading it anew says what is wrong
