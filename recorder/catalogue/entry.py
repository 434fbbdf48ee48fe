"""What the catalogue knows of one recording, read from its log."""

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path
from stat import S_ISLNK, S_ISREG
from typing import Final

from recorder.log.session_changes import session_changes
from recorder.reading.info import LogInfo, info
from recorder.reading.log_reader import ForeignFileError
from recorder.reading.records import link_text
from rig.api.fields import LONGEST_TAG
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.host.file_names import is_recording_id
from rig.phrase import NOTHING, Phrase
from rig.pulse import Pause
from rig.topics import TAG

SUFFIX: Final = ".mcap"


class LogState(StrEnum):
    """The state of a log, as far as its tags and lengths tell; `verify` checks more."""

    CLOSED = "closed"  #: closed properly
    WRITING = "writing"  #: a program is writing it now
    UNFINISHED = "unfinished"  #: never closed; readable up to its last second
    DAMAGED = "damaged"  #: part of it cannot be read, or pulses have no tag


class Trouble(StrEnum):
    """What is the matter with a file of which nothing can be read, or not all."""

    NONE = ""
    HEADLESS = "headless"  #: no log of svev, or its beginning is damaged
    LINK = "link"  #: a link, which is not followed
    NO_FILE = "no_file"  #: a folder or a device
    SESSION = "session"  #: the log is as good as it is; the changes of its session cannot be read
    UNREADABLE = "unreadable"  #: anything else


@dataclass(frozen=True, slots=True)
class Entry:
    """A recording.

    Attributes:
        id: name of the file without `.mcap`.
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
        rig: name of the rig, as its file has it: as a rule the hill.
        disk: frames that were lost because of the disk; empty text: none.
        forgotten_s: after so many seconds it ended by itself, because nobody had stopped it; 0: otherwise.
        ended_early: why it ends before the recording was to end, or that this is not known; empty text: as was wanted.
        next_part: id of the part in which it goes on; empty: in none.
        parts: ids of its parts, itself the first; one alone if it is not split.
        trouble: what could not be read, and what to do, in one line; empty if all could be read.
        kind: of the trouble.
    """

    id: str
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
    rig: str = ""
    disk: Phrase = NOTHING
    forgotten_s: float = 0.0
    ended_early: Phrase = NOTHING
    next_part: str = ""
    parts: tuple[str, ...] = ()
    trouble: str = ""
    kind: Trouble = Trouble.NONE

    @property
    def partial(self) -> int:
        """Pulses that not every camera delivered."""
        return self.pulses - self.complete

    @property
    def time(self) -> UtcNs:
        """By which it is sorted: of the first pulse, otherwise when the file was last written."""
        return self.modified if self.started is None else self.started

    @property
    def tags(self) -> tuple[str, ...]:
        """The tags that people gave to it."""
        return tuple(filter(None, (tag.strip()[:LONGEST_TAG] for tag in self.session.get("tags", "").split(","))))

    @property
    def favourite(self) -> bool:
        """Whether it is marked as a favourite."""
        return bool(self.session.get("favourite"))


def read_entry(path: Path) -> Entry:
    """Read the tags of a log, but no pixels, and not the changes of its session.

    A file that cannot be read is an entry, too: it says what is wrong.

    Raises:
        FileNotFoundError: the file is no longer there.
    """
    stat = path.lstat()
    if S_ISLNK(stat.st_mode):
        return _trouble(path, stat, link_text(path), Trouble.LINK)
    try:
        if not S_ISREG(stat.st_mode):
            text = f"{path}: is a folder or a device, no log; move it out of the folder"
            return _trouble(path, stat, text, Trouble.NO_FILE)
        found = info(path, original=True, links=False)  # another file may have got the name
    except ForeignFileError:
        text = f"{path}: is no log of svev, or its beginning is damaged; try svev recover, or move it out of the folder"
        return _trouble(path, stat, text, Trouble.HEADLESS)
    except Exception as error:  # noqa: BLE001 - whatever is odd about one file, the others are listed
        path.lstat()  # it may have been removed meanwhile
        return _trouble(path, stat, _in_words(path, error))
    ledger = found.ledger
    return Entry(
        path.stem, found.bytes, UtcNs(stat.st_mtime_ns), _state(found),
        started=ledger.first_time, duration_s=ledger.duration_s,
        pulses=ledger.pulses, complete=ledger.complete, missing=found.missing_pulses,
        causes=dict(ledger.failed.causes), failures=ledger.failed.cameras, pauses=ledger.pauses(),
        cameras=found.cameras, shape=found.shape, session=found.session, rig=found.rig.get("name", ""),
        disk=found.disk, forgotten_s=found.forgotten_s, ended_early=found.ended_early_said,
        next_part=found.next_part, parts=(path.stem,),
    )  # fmt: skip


_GRAVEST: Final = (LogState.DAMAGED, LogState.WRITING, LogState.UNFINISHED, LogState.CLOSED)


def joined(parts: Sequence[Entry]) -> Entry:
    """A recording that is split into these parts, as one entry with the id and the session of the first one."""
    first, last = parts[0], parts[-1]
    if len(parts) == 1:
        return first
    began = [part.started for part in parts if part.started is not None]
    ends = [part.started + round(part.duration_s * NS_PER_S) for part in parts if part.started is not None]
    failures: dict[str, Counter[FrameStatus]] = {}
    for part in parts:
        for camera, causes in part.failures.items():
            failures.setdefault(camera, Counter()).update(causes)
    return replace(
        first,
        bytes=sum(part.bytes for part in parts),
        state=min((part.state for part in parts), key=_GRAVEST.index),
        started=min(began, default=None),
        duration_s=(max(ends) - min(began)) / NS_PER_S if began else 0.0,
        pulses=sum(part.pulses for part in parts),
        complete=sum(part.complete for part in parts),
        missing=sum(part.missing for part in parts),
        causes=dict(sum((Counter(part.causes) for part in parts), Counter())),
        failures=failures,
        pauses=tuple(pause for part in parts for pause in part.pauses),
        disk=next((part.disk for part in parts if part.disk.text), NOTHING),
        forgotten_s=last.forgotten_s,
        ended_early=last.ended_early,
        next_part=last.next_part,
        parts=tuple(part.id for part in parts),
        trouble=next((part.trouble for part in parts if part.trouble), ""),
        kind=next((part.kind for part in parts if part.trouble), Trouble.NONE),
    )


def _in_words(path: Path, error: Exception) -> str:
    if isinstance(error, BadInputError):
        return str(error)
    if isinstance(error, OSError):
        return f"{path}: cannot be looked at ({error.strerror}); check its permissions"
    return f"{path}: cannot be read ({type(error).__name__}); see what is wrong with svev verify"


def _trouble(path: Path, stat: os.stat_result, text: str, kind: Trouble = Trouble.UNREADABLE) -> Entry:
    """The entry of a file of which nothing can be read."""
    return Entry(path.stem, stat.st_size, UtcNs(stat.st_mtime_ns), LogState.DAMAGED, trouble=text, kind=kind)


def unlisted_logs(folder: Path) -> list[str]:
    """Names of the logs in a folder that no list can show, since no address can hold them; hidden ones are nobody's.

    Raises:
        OSError: the folder cannot be read.
    """
    names = (name for name in os.listdir(folder) if name.endswith(SUFFIX) and not name.startswith("."))  # noqa: PTH208
    return sorted(name for name in names if not is_recording_id(name.removesuffix(SUFFIX)))


def with_changes(entry: Entry, path: Path, *, deleted: bool) -> Entry:
    """The entry with the present changes of its session."""
    try:
        return replace(entry, session={**entry.session, **session_changes(path)}, deleted=deleted)
    except BadInputError as error:
        if entry.trouble:  # the log's own is the graver one
            return replace(entry, deleted=deleted)
        return replace(entry, trouble=str(error), kind=Trouble.SESSION, deleted=deleted)


def _state(found: LogInfo) -> LogState:
    unexplained = set(found.ledger.missing) - set(found.known_lost)
    unreadable_tags = found.messages.get(TAG.name, 0) - found.ledger.pulses - len(found.ledger.out_of_order)
    unfinished_bytes = 0 if found.closed else found.torn_bytes  # what looks torn in front of a footer is damage
    if found.damaged_bytes > unfinished_bytes or unexplained or unreadable_tags or found.ledger.out_of_order:
        return LogState.DAMAGED
    return LogState.CLOSED if found.closed else LogState.UNFINISHED
