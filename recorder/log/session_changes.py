"""Reads and writes the session fields that were changed after a recording; the log itself is never rewritten.

They stand in a small file beside the log, `jump.session.json` for `jump.mcap`: one JSON object, the text of each
changed field by name.
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path

from rig.errors import BadInputError


def session_path(log: Path) -> Path:
    """Path of the file with the changes of a log."""
    return log.with_name(f"{log.stem}.session.json")


def session_changes(log: Path) -> dict[str, str]:
    """The changed fields of a log, empty if there are none.

    Raises:
        BadInputError: the file exists, but cannot be read or holds something else.
    """
    path = session_path(log)
    try:
        changes = json.loads(path.read_bytes())
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
    except ValueError:
        changes = None
    if not isinstance(changes, dict) or not all(isinstance(text, str) for text in changes.values()):
        raise BadInputError(f"{path}: holds no session fields; correct it, or remove it to undo the changes")
    return changes


def write_session_changes(log: Path, changes: Mapping[str, str]) -> None:
    """Replace the changes of a log; after a power loss the file holds the old ones or the new ones.

    Raises:
        OSError: the disk refuses.
    """
    path = session_path(log)
    half_done = path.with_name(f".{path.name}.new")
    with half_done.open("w", encoding="utf-8") as file:
        json.dump(dict(changes), file, ensure_ascii=False, indent=1)
        file.flush()
        os.fsync(file.fileno())
    half_done.replace(path)
