"""The sessions of all operators who measure one log by hand."""

import threading
from collections.abc import Iterable
from pathlib import Path

from analysis.digitizing.marks.journal import SUFFIX, Journal, operators
from analysis.digitizing.marks.session import Session
from rig.errors import BadInputError
from rig.phrase import phrase


class Sessions:
    """Any thread may call any method.

    Args:
        folder: of the journals; made when the first operator begins.
        recording: id of the recording.
    """

    def __init__(self, folder: Path, recording: str) -> None:
        self._folder, self._recording = folder, recording
        self._opened: dict[str, Session] = {}
        self._lock = threading.Lock()

    def of(self, operator: str) -> Session:
        """The session of an operator, opened at the first call.

        Raises:
            BadInputError, StorageError: of its journal.
        """
        with self._lock:
            if operator not in self._opened:
                path = self._folder / f"{operator}{SUFFIX}"
                self._opened[operator] = Session(Journal(path, self._recording, operator))
            return self._opened[operator]

    def names(self) -> list[str]:
        """Who has measured."""
        return operators(self._folder)

    def require(self, names: Iterable[str]) -> None:
        """Refuse those who have measured nothing.

        Raises:
            BadInputError: there are such.
        """
        known = self.names()
        if strange := [name for name in names if name not in known]:
            raise BadInputError(
                phrase(
                    "hand_strangers",
                    "{names} measured nothing here; these did: {known}",
                    names=", ".join(strange),
                    known=", ".join(known) or "-",
                )
            )

    def close(self) -> None:
        """Let other programs have the journals."""
        with self._lock:
            for session in self._opened.values():
                session.close()
            self._opened.clear()
