"""The logs that wait to be measured, in order; a file keeps them for a service that starts again."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter, ValidationError

from rig.errors import StateForbidsError
from rig.events import Event, Level
from rig.host.disk import replace_file
from rig.host.files import TEXT_MAX, read_whole
from rig.phrase import Phrase, phrase

NAME: Final = ".svev-measuring.json"
_MOST_LOGS: Final = 2000
_IDS: Final = TypeAdapter(list[str])


class WaitingLogs:
    """Ids of recordings. Any thread may call any method.

    Args:
        folder: folder of the recordings.
        tell: takes an event for the live log, where the file cannot be read or written.
    """

    def __init__(self, folder: Path, tell: Callable[[Event], None]) -> None:
        self._file, self._tell = folder / NAME, tell
        self._ids: list[str] = []
        self._kept: list[str] | None = None
        self._lock = threading.Lock()

    def __contains__(self, recording: str) -> bool:
        return recording in self._ids

    @property
    def ids(self) -> list[str]:
        """All of them, in order."""
        with self._lock:
            return list(self._ids)

    def add(self, recording: str, *, first: bool = False) -> None:
        """Let a log wait behind the others, or before them, unless it waits already.

        Raises:
            StateForbidsError: too many wait.
        """
        with self._lock:
            if recording in self._ids:
                return
            if len(self._ids) >= _MOST_LOGS:
                raise StateForbidsError(
                    phrase(
                        "measuring_queue_full",
                        "{count} logs are waiting already: wait until some are measured",
                        count=_MOST_LOGS,
                    )
                )
            self._ids.insert(0 if first else len(self._ids), recording)

    def remove(self, recording: str) -> None:
        """Let a log wait no more."""
        with self._lock:
            if recording in self._ids:
                self._ids.remove(recording)

    def load(self) -> None:
        """Append the logs that waited in an earlier service."""
        try:
            before = _IDS.validate_json(read_whole(self._file, TEXT_MAX, links=False))
        except FileNotFoundError:
            return
        except (OSError, ValidationError) as error:
            text = "{file}: cannot be read, so logs that waited to be measured are forgotten ({why})"
            why = str(error).partition("\n")[0]
            self._warn(phrase("event_no_queue", text, file=NAME, why=why))
            return
        with self._lock:
            self._ids += [recording for recording in before if recording not in self._ids]
            del self._ids[_MOST_LOGS:]

    def keep(self) -> None:
        """Write the file, if anything has changed."""
        ids = self.ids
        if ids == self._kept or not (ids or self._kept):
            return
        self._kept = ids  # a disk that refuses is told of once for each change
        try:
            replace_file(self._file, _IDS.dump_json(ids), links=False)
        except OSError as error:
            text = "{file}: cannot be written ({why}): a service that starts again does not know what to measure"
            why = error.strerror or str(error)
            self._warn(phrase("event_queue_not_kept", text, file=NAME, why=why))

    def _warn(self, said: Phrase) -> None:
        self._tell(Event.now(Level.WARNING, "analysis", said))
