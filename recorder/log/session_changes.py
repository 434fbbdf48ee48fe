"""Reads and writes the session fields that were changed after a recording; the log itself is never rewritten.

They stand in a small file beside the log, `jump.session.json` for `jump.mcap`: one JSON object, the text of each
changed field by name.
"""

import errno
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import msgspec

from rig.errors import BadInputError
from rig.host.disk import replace_file
from rig.host.files import UntrustedFileError, read_whole

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
        text = read_whole(path, _BYTES_MAX, links=False)
    except FileNotFoundError:
        return {}
    except UntrustedFileError as error:
        if error.errno == errno.EFBIG:
            raise BadInputError(f"{path}: is larger than {_BYTES_MAX >> 10} KiB; shorten it, or remove it") from None
        raise BadInputError(f"{path}: {error.strerror}: remove it") from None
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:  # nobody can have written changes of a log with so long a name
            return {}
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
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
    replace_file(path, json.dumps(dict(changes), ensure_ascii=False, indent=1).encode(), links=False)
