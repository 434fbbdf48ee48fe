"""Reads and writes the session fields that were changed after a recording; the log itself is never rewritten.

They stand in a small file beside the log, `jump.session.json` for `jump.mcap`: one JSON object, the text of each
changed field by name.
"""

import errno
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import msgspec

from rig.errors import BadInputError
from rig.host.file_names import unfinished_path

#: A request to the service has at most so many bytes; more text than that was not written by svev.
_BYTES_MAX: Final = 64 << 10


def session_path(log: Path) -> Path:
    """Path of the file with the changes of a log."""
    return log.with_name(session_name(log.stem))


def session_name(recording: str) -> str:
    """Name of the file with the changes of a recording's log."""
    return f"{recording}.session.json"


def session_changes(log: Path) -> dict[str, str]:
    """The changed fields of a log, empty if there are none.

    Raises:
        BadInputError: the file exists, but cannot be read, is too large, or holds something else.
    """
    path = session_path(log)
    try:
        text = _read(path)
    except FileNotFoundError:
        return {}
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:  # nobody can have written changes of a log with so long a name
            return {}
        if error.errno == errno.ELOOP:
            raise BadInputError(f"{path}: is a link, and links are not followed; remove it") from None
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
    if len(text) > _BYTES_MAX:
        raise BadInputError(f"{path}: is larger than {_BYTES_MAX >> 10} KiB; shorten it, or remove it")
    try:
        return msgspec.json.decode(text, type=dict[str, str])
    except ValueError:
        raise BadInputError(f"{path}: holds no session fields; correct it, or remove it to undo the changes") from None


def write_session_changes(log: Path, changes: Mapping[str, str]) -> None:
    """Replace the changes of a log; after a power loss the file holds the old ones or the new ones.

    Raises:
        OSError: the disk refuses.
    """
    path = session_path(log)
    half_done = unfinished_path(path, ".new")
    half_done.unlink(missing_ok=True)
    with half_done.open("x", encoding="utf-8") as file:
        json.dump(dict(changes), file, ensure_ascii=False, indent=1)
        file.flush()
        os.fsync(file.fileno())
    half_done.replace(path)


def _read(path: Path) -> bytes:
    """The file, no more of it than a byte above the limit. A pipe of this name is empty: nobody waits for it."""
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOFOLLOW)
    try:
        return os.read(fd, _BYTES_MAX + 1)
    finally:
        os.close(fd)
