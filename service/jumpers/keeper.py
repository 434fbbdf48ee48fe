"""Keeps the start list in a file of the recordings' folder, so that a service that is started again goes on with it.

The lists to which the last changes can be undone stand in a file of their own: an older version of the service, after a
roll-back, reads the list all the same.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from rig.api.fields import Model
from rig.api.start_list import StartList
from rig.api.statement import Statement
from rig.events import Event, Level
from rig.host.disk import replace_file
from rig.host.files import TEXT_MAX, read_whole
from rig.host.latest import LatestWriter
from rig.phrase import phrase, plain

NAME: Final = ".svev-start-list.json"
UNDO_NAME: Final = ".svev-start-list-undo.json"


class Change(Model):
    """A change that can be undone: its description, and the list before it."""

    said: Statement
    before: StartList


class _Changes(Model):
    """The changes that led to a version of the start list, oldest first."""

    version: int
    changes: tuple[Change, ...]


class Keeper:
    """Writes in a thread of its own.

    Args:
        folder: folder of the recordings.
        tell: takes an event about a list that could not be read or written; any thread may call it.
    """

    def __init__(self, folder: Path, tell: Callable[[Event], None]) -> None:
        self._path, self._undo_path, self._tell = folder / NAME, folder / UNDO_NAME, tell
        self._writer = LatestWriter("start list", self._lament)

    def load(self) -> tuple[StartList, tuple[Change, ...]]:
        """The list that was kept, with the changes that can be undone; an empty one if there is none.

        A file that cannot be read is put aside.
        """
        try:
            found = StartList.model_validate_json(read_whole(self._path, TEXT_MAX, links=False))
        except FileNotFoundError:
            return StartList(), ()
        except (OSError, ValidationError) as error:
            return self._put_aside(error), ()
        changes = self._load_changes(found.version)
        return found.model_copy(update={"undo": changes[-1].said if changes else None}), changes

    def _load_changes(self, version: int) -> tuple[Change, ...]:
        """The changes that led to this version; none if another version of the service has changed the list since."""
        try:
            found = _Changes.model_validate_json(read_whole(self._undo_path, TEXT_MAX, links=False))
        except (OSError, ValidationError):  # the list itself is what matters
            return ()
        return found.changes if found.version == version else ()

    def keep(self, start_list: StartList, changes: tuple[Change, ...]) -> None:
        """Begin to write a list, and the changes that can be undone, oldest first."""
        kept = _Changes(version=start_list.version, changes=changes)

        def write() -> None:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            replace_file(self._path, start_list.model_dump_json(indent=1).encode(), links=False)
            replace_file(self._undo_path, kept.model_dump_json().encode(), links=False)

        self._writer.write(write)

    def wait(self, timeout_s: float) -> bool:
        """Wait until the latest list is written, or refused; False if that takes longer than `timeout_s`."""
        return self._writer.wait(timeout_s)

    def _lament(self, error: OSError) -> None:
        text = "{path}: the start list cannot be kept ({why}); a restart of the service loses it"
        said = phrase("event_list_not_kept", text, path=str(self._path), why=error.strerror or str(error))
        self._tell(Event.now(Level.ERROR, "start list", said))

    def _put_aside(self, error: Exception) -> StartList:
        aside = self._path.with_suffix(".unreadable")
        other = phrase("why_other_version", "it is none of this version of svev")
        why = plain(error.strerror or str(error)) if isinstance(error, OSError) else other
        text = "{path}: cannot be read ({why}) and is put aside as {aside}; load the start list again"
        said = phrase("event_list_put_aside", text, path=str(self._path), why=why, aside=aside.name)
        try:
            self._path.replace(aside)
        except OSError as refusal:
            text = "{path}: cannot be read ({why}) nor put aside ({refusal}); check its permissions"
            refused = refusal.strerror or str(refusal)
            said = phrase("event_list_unreadable", text, path=str(self._path), why=why, refusal=refused)
        self._tell(Event.now(Level.ERROR, "start list", said))
        return StartList()
