"""Which recordings lie on the other disk, as they were when they were copied: a file beside the recordings."""

import hashlib
import threading
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter, ValidationError

from recorder.catalogue.trash import beside
from rig.api.fields import Model
from rig.api.statement import Level as StatementLevel
from rig.api.statement import Statement
from rig.events import Event, Level
from rig.host.disk import replace_file
from rig.host.files import TEXT_MAX, read_whole
from rig.phrase import Phrase, phrase

NAME: Final = ".svev-offload.json"


class CopyNote(Model):
    """What came of the copy of a recording.

    Attributes:
        mark: of what was copied, as `mark_of` gives it.
        time: when, UTC.
        problem: why it failed.
    """

    mark: str
    time: datetime
    problem: Statement | None = None


_NOTES: Final = TypeAdapter(dict[str, CopyNote])


class CopyNotes:
    """Notes of all recordings of a folder. Any thread may call any method.

    Args:
        folder: folder of the recordings.
        tell: takes an event for the live log, where the file cannot be read or written: then recordings are looked at
            once more, and nothing is lost.
    """

    def __init__(self, folder: Path, tell: Callable[[Event], None]) -> None:
        self._file, self._tell = folder / NAME, tell
        self._lock = threading.Lock()
        self._notes = self._load()

    def of(self, recording: str) -> CopyNote | None:
        """What came of the copy of a recording; None: it was never tried."""
        return self._notes.get(recording)

    def is_copied(self, log: Path) -> bool:
        """Whether a recording lies on the other disk as it is now."""
        note = self.of(log.stem)
        return note is not None and note.problem is None and note.mark == mark_of(log)

    def note(self, log: Path, mark: str, problem: Statement | None) -> None:
        """Note what came of a copy."""
        with self._lock:
            there = {name: note for name, note in self._notes.items() if log.with_name(f"{name}{log.suffix}").exists()}
            self._notes = there | {log.stem: CopyNote(mark=mark, time=datetime.now(UTC), problem=problem)}
            try:
                replace_file(self._file, _NOTES.dump_json(self._notes), links=False)
            except OSError as error:
                text = "{file}: cannot be written ({why}): a service that starts again copies recordings once more"
                why = error.strerror or str(error)
                self._warn(phrase("event_copies_not_kept", text, file=NAME, why=why))

    def _load(self) -> dict[str, CopyNote]:
        try:
            return _NOTES.validate_json(read_whole(self._file, TEXT_MAX, links=False))
        except FileNotFoundError:
            return {}
        except (OSError, ValidationError) as error:
            text = "{file}: cannot be read ({why}): recordings are copied once more"
            why = str(error).partition("\n")[0]
            self._warn(phrase("event_copies_unknown", text, file=NAME, why=why))
            return {}

    def _warn(self, said: Phrase) -> None:
        self._tell(Event.now(Level.WARNING, "service", said))


def as_warning(why: Phrase) -> Statement:
    """Why something with a recording failed, as its page shows it."""
    return Statement(level=StatementLevel.WARNING, code=why.code, text=why.text, values=why.values)


def mark_of(log: Path) -> str:
    """What changes when a log or anything beside it does: names, sizes and times of change, as SHA-256."""
    digest = hashlib.sha256()
    for path in (log, *beside(log)):
        for each in (path, *sorted(path.rglob("*"))) if path.is_dir() else (path,):
            try:
                stat = each.lstat()
            except FileNotFoundError:
                continue
            digest.update(f"{each.name} {stat.st_size} {stat.st_mtime_ns}\n".encode())
    return digest.hexdigest()
