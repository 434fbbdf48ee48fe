"""Keeps what was read from the logs of a folder until their files change."""

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from recorder.catalogue.entry import Entry, LogState, read_entry
from recorder.catalogue.index_file import FileKey, KeptEntry, file_key, keep, load_kept
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import stored_triplets
from rig.errors import BadInputError
from rig.pulse import PulseNumber

#: A growing log is read again when this many times the duration of the last reading has passed.
_PATIENCE: Final = 10
#: The places of the images of so many logs are kept.
_PLACES_MAX: Final = 4


@dataclass(frozen=True, slots=True)
class _Places:
    """Where the images of a log stand: offset and length by pulse; `key`: of the file when it was read."""

    key: FileKey
    by_pulse: Mapping[PulseNumber, tuple[int, int]]


class LogCache:
    """What was read from the logs of a folder. Reads one log at a time, whichever thread asks."""

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self._lock = threading.Lock()
        self._read: dict[Path, KeptEntry] | None = None  # not yet loaded
        self._fresh_until: dict[Path, float] = {}  # of growing logs, on `time.monotonic`, s
        self._places: dict[Path, _Places] = {}
        self._unsaved = False

    def entry(self, path: Path) -> Entry:
        """The entry of a file without its session's changes.

        Raises:
            FileNotFoundError: the file is no longer there.
        """
        with self._lock:
            if self._read is None:
                self._read = load_kept(self._directory)
            try:
                key = file_key(path)
            except OSError:
                return read_entry(path)  # it says why, at every look
            known = self._read.get(path)
            if known is not None and (known.key == key or self._still_growing(path, known)):
                return known.entry
            began = time.monotonic()
            entry = read_entry(path)
            now = time.monotonic()
            self._read[path] = KeptEntry(key, entry)
            self._fresh_until[path] = now + _PATIENCE * (now - began)
            # A growing log is another one at every look: it is saved with others, when it has ended.
            self._unsaved = self._unsaved or entry.state is not LogState.UNFINISHED
            return entry

    def save(self) -> None:
        """Keep the entries for the next service, if there are new ones, without those of files that are gone."""
        with self._lock:
            if self._unsaved and self._read is not None:
                self._read = {path: each for path, each in self._read.items() if path.is_file()}
                keep(self._directory, self._read)
                self._unsaved = False

    def image_places(self, path: Path, pulse: int) -> Mapping[PulseNumber, tuple[int, int]]:
        """Offset and length of the log's image messages by pulse, that of `pulse` among them if there is one.

        Places in a log that has only grown since it was read are still true.

        Raises:
            BadInputError: the log cannot be read.
        """
        with self._lock:
            try:
                key, known = file_key(path), self._places.pop(path, None)
            except OSError as error:
                raise BadInputError(f"{path}: cannot be read ({error.strerror}); correct or remove it") from None
            if known is None or (known.key != key and (known.key[0] != key[0] or pulse not in known.by_pulse)):
                with LogReader(path, skim=True) as reader:
                    by_pulse = {stored.tag.pulse: (stored.offset, stored.length) for stored in stored_triplets(reader)}
                known = _Places(key, by_pulse)
            self._places[path] = known  # the newest stands last
            if len(self._places) > _PLACES_MAX:
                del self._places[next(iter(self._places))]
            return known.by_pulse

    def _still_growing(self, path: Path, known: KeptEntry) -> bool:
        """Whether a log that is being written was read only just now."""
        if known.entry.state is not LogState.UNFINISHED or time.monotonic() > self._fresh_until.get(path, 0.0):
            return False
        try:
            if known.key[0] != file_key(path)[0]:
                return False
            with LogReader(path, skim=True) as reader:
                return not reader.closed
        except (OSError, BadInputError):
            return False  # then reading it anew says what is wrong
