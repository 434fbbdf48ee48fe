"""Keeps the open sessions in a file of the recordings' folder: a page that nobody touches goes on after a restart."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from rig.api.fields import Model
from rig.host.disk import replace_file
from rig.host.files import read_own
from rig.host.latest import LatestWriter
from rig.phrase import Phrase, phrase
from webpanel.door.roles import Role

NAME: Final = ".svev-sessions.json"
_MOST_BYTES: Final = 100_000

#: Digest of the key, role, and when it ends, UNIX time, s. A key is random: nobody finds it by its digest.
KeptSession = tuple[str, Role, float]


class _Kept(Model):
    """What stands in the file.

    Attributes:
        mark: of the tokens with which the sessions were begun.
        sessions: oldest first.
    """

    mark: str
    sessions: tuple[KeptSession, ...]


class SessionFile:
    """Reads once, and writes in a thread of its own.

    Args:
        folder: of the recordings.
        mark: another one for other tokens, with which all sessions end.
        lament: told once that sessions cannot be kept.
    """

    def __init__(self, folder: Path, mark: str, lament: Callable[[Phrase], None]) -> None:
        self._path, self._mark, self._lament = folder / NAME, mark, lament
        self._writer = LatestWriter("sessions", self._refused)

    def load(self) -> tuple[KeptSession, ...]:
        """The sessions that were kept; none if the tokens are others now, or the file is not ours."""
        try:
            kept = _Kept.model_validate_json(read_own(self._path, _MOST_BYTES))
        except (OSError, ValidationError):  # everybody logs in again
            return ()
        return kept.sessions if kept.mark == self._mark else ()

    def keep(self, sessions: Iterable[KeptSession]) -> None:
        """Begin to write the sessions, oldest first."""
        kept = _Kept(mark=self._mark, sessions=tuple(sessions))
        self._writer.write(lambda: replace_file(self._path, kept.model_dump_json().encode(), links=False))

    def wait(self, timeout_s: float) -> bool:
        """Wait until the latest sessions are written, or refused; False if that takes longer than `timeout_s`."""
        return self._writer.wait(timeout_s)

    def _refused(self, error: OSError) -> None:
        text = "{path} cannot be written ({why}): after a restart of the service everybody logs in again"
        why = error.strerror or str(error)
        self._lament(phrase("event_sessions_not_kept", text, path=str(self._path), why=why))
