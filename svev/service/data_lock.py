"""One service per data directory."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rig.errors import BadInputError


@contextmanager
def data_lock(directory: Path) -> Iterator[None]:
    """Hold a directory for recordings, which is made if missing. The kernel lets go of it when the process ends.

    Raises:
        BadInputError: another service holds it, or it cannot be made or written.
    """
    path = directory / ".svev.lock"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise BadInputError(
            f"{directory}: cannot be written ({error.strerror}); choose another --data or correct its permissions"
        ) from None
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(file, 20, 0).decode(errors="replace").strip() or "unknown"
            raise BadInputError(
                f"{directory}: another svev serve (process {holder}) uses it: end that one, or choose another --data"
            ) from None
        os.ftruncate(file, 0)
        os.pwrite(file, f"{os.getpid()}\n".encode(), 0)
        yield
    finally:
        os.close(file)
