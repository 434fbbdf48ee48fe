"""Session fields that were changed after the recording: a small file beside the log, which itself is never rewritten.

`jump.mcap` has `jump.session.json`: one JSON object, the text of each changed field by name.
"""

import json
import os
from collections.abc import Mapping
from pathlib import Path

from rig.errors import BadInputError


def session_path(log: Path) -> Path:
    """Where the changes of a log stand."""
    return log.with_name(f"{log.stem}.session.json")


def session_changes(log: Path) -> dict[str, str]:
    """The changed fields of a log, empty if there are none.

    Raises:
        BadInputError: the file is there, but not readable as what it should be.
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
    """Replace the changes of a log; after a power loss the old ones stand there or the new ones.

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
