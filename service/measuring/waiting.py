"""The logs that wait to be measured, in order; a file keeps them for a service that starts again."""

import threading
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter, ValidationError

from rig.errors import StateForbidsError
from rig.events import Event, Level
from rig.host.disk import replace_file
from rig.host.files import TEXT_MAX, read_whole
from rig.host.latest import LatestWriter
from rig.phrase import Phrase, phrase

NAME: Final = ".svev-measuring.json"
_MOST_LOGS: Final = 2000
_IDS: Final = TypeAdapter(list[str])


class QueueFile:
    """Keeps which logs wait.

    It is written in a thread of its own as soon as that changes: measuring one log may take minutes, and the computer
    may lose its power meanwhile.

    Args:
        folder: folder of the recordings.
        tell: takes an event for the live log, where the file cannot be read or written.
    """

    def __init__(self, folder: Path, tell: Callable[[Event], None]) -> None:
        self._file, self._tell = folder / NAME, tell
        self._kept: list[str] | None = None  # None: not read yet, so nothing is written over it
        self._writer = LatestWriter("measuring queue", self._lament)

    def read(self) -> list[str]:
        """The logs that waited in an earlier service. From now on the file is written."""
        try:
            self._kept = _IDS.validate_json(read_whole(self._file, TEXT_MAX, links=False))
        except FileNotFoundError:
            self._kept = []
        except (OSError, ValidationError) as error:
            self._kept = []
            text = "{file}: cannot be read, so logs that waited to be measured are forgotten ({why})"
            why = str(error).partition("\n")[0]
            self._warn(phrase("event_no_queue", text, file=NAME, why=why))
        return self._kept

    def keep(self, ids: list[str]) -> None:
        """Begin to write the logs that wait, if they are others than those in the file."""
        if self._kept is not None and ids != self._kept:
            self._kept = ids
            self._writer.write(partial(replace_file, self._file, _IDS.dump_json(ids), links=False))

    def wait(self, timeout_s: float) -> bool:
        """Wait until the file is written, or refused; False if that takes longer."""
        return self._writer.wait(timeout_s)

    def _lament(self, error: OSError) -> None:
        text = "{file}: cannot be written ({why}): a service that starts again does not know what to measure"
        self._warn(phrase("event_queue_not_kept", text, file=NAME, why=error.strerror or str(error)))

    def _warn(self, said: Phrase) -> None:
        self._tell(Event.now(Level.WARNING, "analysis", said))


class WaitingLogs:
    """Ids of recordings. Any thread may call any method.

    Args:
        changed: takes all of them after each change, one call after the other; it must not take long.
    """

    def __init__(self, changed: Callable[[list[str]], None] = lambda _: None) -> None:
        self._changed = changed
        self._ids: list[str] = []
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
            self._changed(list(self._ids))

    def remove(self, recording: str) -> None:
        """Let a log wait no more."""
        with self._lock:
            if recording in self._ids:
                self._ids.remove(recording)
                self._changed(list(self._ids))

    def go_on(self, before: Iterable[str]) -> None:
        """Append the logs that waited in an earlier service."""
        with self._lock:
            self._ids += [recording for recording in before if recording not in self._ids]
            del self._ids[_MOST_LOGS:]
            self._changed(list(self._ids))
