"""What the catalogue knows of one recording, read from its log and kept until the file changes."""

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from typing import Final

from recorder.log.session_changes import session_changes
from recorder.reading.info import LogInfo, info
from recorder.reading.log_reader import ForeignFileError, LogReader
from recorder.reading.triplets import stored_triplets
from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.pause import Pause
from rig.pulse import PulseNumber

#: A growing log is read again when this many times the duration of the last reading has passed.
_PATIENCE: Final = 10
#: The places of the images of so many logs are kept.
_PLACES_MAX: Final = 4

_FileKey = tuple[int, int, int]


class LogState(StrEnum):
    """The state of a log, as far as its tags and lengths tell; `verify` checks more."""

    CLOSED = "closed"  #: closed properly
    UNFINISHED = "unfinished"  #: still being written, or never closed; readable up to its last second
    DAMAGED = "damaged"  #: part of it cannot be read, or pulses have no tag


@dataclass(frozen=True, slots=True)
class Entry:
    """A recording.

    Attributes:
        id: name of the file without `.mcap`.
        path: the log.
        bytes: size of the file.
        modified: when the file was last written.
        state: state of the log.
        deleted: the log lies in the trash.
        started: time of the first pulse, None if there is no pulse.
        duration_s: from the first to the last pulse, s.
        pulses: number of pulses that have a tag.
        complete: how many of them every camera delivered.
        missing: number of pulses without a tag.
        causes: number of frames that are missing, by cause.
        failures: the same by name of the camera, without the cameras that delivered all frames.
        pauses: stretches of time without a pulse.
        cameras: names, left to right.
        shape: rows and columns of the triplets, None if there is no pulse.
        session: the session's fields, with later changes applied.
        trouble: what could not be read, and what to do, in one line; empty if all could be read.
    """

    id: str
    path: Path
    bytes: int
    modified: UtcNs
    state: LogState
    deleted: bool = False
    started: UtcNs | None = None
    duration_s: float = 0.0
    pulses: int = 0
    complete: int = 0
    missing: int = 0
    causes: Mapping[FrameStatus, int] = field(default_factory=dict)
    failures: Mapping[str, Mapping[FrameStatus, int]] = field(default_factory=dict)
    pauses: tuple[Pause, ...] = ()
    cameras: tuple[str, ...] = ()
    shape: tuple[int, int] | None = None
    session: Mapping[str, str] = field(default_factory=dict)
    trouble: str = ""

    @property
    def partial(self) -> int:
        """Pulses that not every camera delivered."""
        return self.pulses - self.complete


def read_entry(path: Path) -> Entry:
    """Read the tags of a log, but no pixels, and not the changes of its session. A broken log is an entry, too.

    Raises:
        ForeignFileError: the file is no log of svev.
        FileNotFoundError: the file is no longer there.
    """
    stat = path.stat()
    modified = UtcNs(stat.st_mtime_ns)
    try:
        found = info(path, original=True)
    except ForeignFileError:
        raise
    except BadInputError as error:
        return Entry(path.stem, path, stat.st_size, modified, LogState.DAMAGED, trouble=str(error))
    ledger = found.ledger
    return Entry(
        path.stem, path, found.bytes, modified, _state(found),
        started=ledger.first_time, duration_s=ledger.duration_s,
        pulses=ledger.pulses, complete=ledger.complete, missing=found.missing_pulses,
        causes=dict(ledger.causes), failures=ledger.failures, pauses=ledger.pauses(),
        cameras=found.cameras, shape=found.shape, session=found.session,
    )  # fmt: skip


def with_changes(entry: Entry, path: Path, *, deleted: bool) -> Entry:
    """The entry with the present changes of its session."""
    try:
        session, trouble = {**entry.session, **session_changes(path)}, entry.trouble
    except BadInputError as error:
        session, trouble = dict(entry.session), str(error)
    return replace(entry, session=session, trouble=trouble, deleted=deleted)


@dataclass(frozen=True, slots=True)
class _Read:
    """What reading a file gave; entry None: it is no log of svev. `fresh_until`: on `time.monotonic`, s."""

    key: _FileKey
    entry: Entry | None
    fresh_until: float


@dataclass(frozen=True, slots=True)
class _Places:
    """Where the images of a log stand: offset and length by pulse; `key`: of the file when it was read."""

    key: _FileKey
    by_pulse: Mapping[PulseNumber, tuple[int, int]]


class LogCache:
    """What was read from logs, kept until their files change. Reads one log at a time, whichever thread asks."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._read: dict[Path, _Read] = {}
        self._places: dict[Path, _Places] = {}

    def entry(self, path: Path) -> Entry | None:
        """The entry of a file without its session's changes, None if the file is no log of svev.

        Raises:
            FileNotFoundError: the file is no longer there.
        """
        with self._lock:
            key, known = _file_key(path), self._read.get(path)
            if known is not None and (known.key == key or self._still_growing(path, known)):
                return known.entry
            began = time.monotonic()
            try:
                entry = read_entry(path)
            except ForeignFileError:
                entry = None
            now = time.monotonic()
            self._read[path] = _Read(key, entry, now + _PATIENCE * (now - began))
            return entry

    def image_places(self, path: Path, pulse: int) -> Mapping[PulseNumber, tuple[int, int]]:
        """Offset and length of the log's image messages by pulse, that of `pulse` among them if there is one.

        Places in a log that has only grown since it was read are still true.

        Raises:
            BadInputError: the log cannot be read.
        """
        with self._lock:
            key, known = _file_key(path), self._places.pop(path, None)
            if known is None or (known.key != key and (known.key[0] != key[0] or pulse not in known.by_pulse)):
                with LogReader(path, skim=True) as reader:
                    by_pulse = {stored.tag.pulse: (stored.offset, stored.length) for stored in stored_triplets(reader)}
                known = _Places(key, by_pulse)
            self._places[path] = known  # the newest stands last
            if len(self._places) > _PLACES_MAX:
                del self._places[next(iter(self._places))]
            return known.by_pulse

    @staticmethod
    def _still_growing(path: Path, known: _Read) -> bool:
        """Whether a log that is being written was read only just now."""
        if known.entry is None or known.entry.state is not LogState.UNFINISHED or time.monotonic() > known.fresh_until:
            return False
        if known.key[0] != _file_key(path)[0]:
            return False
        with LogReader(path, skim=True) as reader:
            return not reader.closed


def _file_key(path: Path) -> _FileKey:
    """What changes when a file does: inode, size, time of the last write."""
    stat = path.stat()
    return stat.st_ino, stat.st_size, stat.st_mtime_ns


def _state(found: LogInfo) -> LogState:
    unexplained = set(found.ledger.missing) - set(found.known_lost)
    unfinished_bytes = 0 if found.closed else found.torn_bytes  # what looks torn in front of a footer is damage
    if found.damaged_bytes > unfinished_bytes or unexplained or found.ledger.out_of_order:
        return LogState.DAMAGED
    return LogState.CLOSED if found.closed else LogState.UNFINISHED
