"""A folder's trash: deleted recordings wait in `.trash` until they are taken out again, or are old enough to go."""

import os
import time
from pathlib import Path

from recorder.session_changes import session_path

SUFFIX = ".mcap"
_FOLDER = ".trash"
_STEM_MAX = 90


class Trash:
    """Moves logs, each with its session changes, into the trash of a folder and out of it. Nothing is overwritten.

    Wherever a crash comes in between, the session changes then lie where `restore` puts them.

    Attributes:
        path: the trash, a folder; made when first needed.
    """

    def __init__(self, directory: Path) -> None:
        self._directory = directory
        self.path = directory / _FOLDER

    def put(self, log: Path) -> Path:
        """Move a log into the trash.

        Returns:
            Where it is now; under another name if one of this name is there already.

        Raises:
            OSError: the disk refuses.
        """
        self.path.mkdir(exist_ok=True)
        target = self.path / self._free_name(log, beside=self.path)
        log.rename(target)
        if session_path(log).exists():
            session_path(log).rename(session_path(target))
        return target

    def restore(self, log: Path) -> Path:
        """Move a log out of the trash.

        Returns:
            Where it is now; under another name if one of this name has come since.

        Raises:
            OSError: the disk refuses.
        """
        target = self._directory / self._free_name(log, beside=self._directory)
        if session_path(log).exists():
            session_path(log).rename(session_path(target))
        log.rename(target)
        return target

    def purge(self, older_than_s: float) -> list[str]:
        """Remove for good what was put here longer ago than this.

        Returns:
            The names of the logs.

        Raises:
            OSError: the disk refuses.
        """
        gone = []
        for log in self.path.glob(f"*{SUFFIX}"):
            # Moving a file changes its inode, writing into it is long past: so this is when it was put here.
            if os.stat(log).st_ctime <= time.time() - older_than_s:  # noqa: PTH116
                log.unlink()
                session_path(log).unlink(missing_ok=True)
                gone.append(log.stem)
        return gone

    def _free_name(self, log: Path, *, beside: Path) -> str:
        """The log's name; if `beside` has it, with the first number that is free both there and in the other folder."""
        if not (beside / log.name).exists():
            return log.name
        number = 2
        while any((folder / self._numbered(log, number)).exists() for folder in (self._directory, self.path)):
            number += 1
        return self._numbered(log, number)

    @staticmethod
    def _numbered(log: Path, number: int) -> str:
        return f"{log.stem[:_STEM_MAX]}-{number}{SUFFIX}"
