"""One recording as the catalogue lists it."""

from collections import Counter, defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

from recorder.info import LogInfo, original_info
from recorder.ledger import Ledger
from recorder.log_reader import ForeignFileError
from recorder.session_changes import session_changes
from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.frame import FrameStatus


class LogState(StrEnum):
    """What a look at the log says; `verify` says more."""

    CLOSED = "closed"  #: closed properly
    UNFINISHED = "unfinished"  #: still being written, or never closed; readable up to its last second
    DAMAGED = "damaged"  #: part of it cannot be read, or pulses have no tag


@dataclass(frozen=True, slots=True)
class Entry:
    """A recording.

    Attributes:
        id: name of the file without `.mcap`.
        bytes: size of the file.
        modified: when the file was last written.
        deleted: it lies in the trash.
        started: time of the first pulse, None if there is no pulse.
        duration_s: from the first to the last pulse, s.
        pulses: number of pulses that have a tag.
        complete: how many of them every camera delivered.
        missing: number of pulses without a tag.
        causes: frames that are not there, by what became of them.
        failures: the same by name of the camera; cameras that delivered all frames are not in it.
        cameras: names, left to right.
        shape: rows and columns of the triplets, None if there is no pulse.
        session: the session's fields, with later changes applied.
        trouble: what could not be read, and what to do, in one line; empty if nothing.
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
    cameras: tuple[str, ...] = ()
    shape: tuple[int, int] | None = None
    session: Mapping[str, str] = field(default_factory=dict)
    trouble: str = ""

    @property
    def partial(self) -> int:
        """Pulses that not every camera delivered."""
        return self.pulses - self.complete


def read_entry(path: Path) -> Entry:
    """Look at a log: its tags, no pixels, and not at the session's changes. A broken log is an entry, too.

    Raises:
        ForeignFileError: it is no log of svev.
        FileNotFoundError: it is no longer there.
    """
    stat = path.stat()
    modified = UtcNs(stat.st_mtime_ns)
    try:
        found = original_info(path)
    except ForeignFileError:
        raise
    except BadInputError as error:
        return Entry(path.stem, path, stat.st_size, modified, LogState.DAMAGED, trouble=str(error))
    ledger = found.ledger
    missing = sum(last - first + 1 for first, last in ledger.missing)
    return Entry(
        path.stem, path, found.bytes, modified, _state(found), False, ledger.first_time, ledger.duration_s,
        ledger.pulses, ledger.complete, missing, dict(ledger.causes), _failures(ledger), found.cameras,
        found.shape, found.session,
    )  # fmt: skip


def with_changes(entry: Entry, path: Path, *, deleted: bool) -> Entry:
    """The entry as it is now: the changes of its session applied."""
    try:
        session, trouble = {**entry.session, **session_changes(path)}, entry.trouble
    except BadInputError as error:
        session, trouble = dict(entry.session), str(error)
    return replace(entry, session=session, trouble=trouble, deleted=deleted)


def _failures(ledger: Ledger) -> dict[str, Counter[FrameStatus]]:
    failures: dict[str, Counter[FrameStatus]] = defaultdict(Counter)
    for pulse in ledger.incomplete:
        for name, status in pulse.cameras:
            failures[name][status] += 1
    return dict(failures)


def _state(found: LogInfo) -> LogState:
    unexplained = set(found.ledger.missing) - set(found.known_lost)
    unfinished_bytes = 0 if found.closed else found.torn_bytes  # what looks torn in front of a footer is damage
    if found.damaged_bytes > unfinished_bytes or unexplained or found.ledger.out_of_order:
        return LogState.DAMAGED
    return LogState.CLOSED if found.closed else LogState.UNFINISHED
