"""Where a log is written that is made of other files, until it is whole: beside its place, under a name of its own."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from recorder.reading.records import FileWindow, is_closed
from rig.errors import BadInputError, StorageError
from rig.host.disk import sync
from rig.host.file_names import give_name, unfinished_path

#: Ending of a log in the making, with the number of its process in it.
_UNFINISHED: Final = ".{pid}.part"
_PROCESS: Final = re.compile(r"\.([0-9]+)\.part$")


def check_target(target: Path) -> None:
    """Say before a long reading, not after it, that the new log cannot be made.

    Raises:
        BadInputError: there is a file of that name, or no such directory.
    """
    if target.exists():
        raise BadInputError(f"{target}: exists already and is never overwritten; choose another name")
    if not target.parent.is_dir():
        raise BadInputError(f"{target.parent}: no such directory; make it, or choose another one")


@contextmanager
def unfinished_log(target: Path, *, replace: bool = False) -> Iterator[Path]:
    """A name beside the target for a log in the making, which gets its own name at the end, all at once.

    Once the log is whole, nothing deletes it: if it cannot get its name, it stays under the one that it has.

    Args:
        target: the name of the log when it is whole.
        replace: put it in the place of a file of that name; otherwise such a file stays as it is.

    Yields:
        The name to write to.

    Raises:
        BadInputError: there is a file of that name by then.
        StorageError: the disk refuses.
    """
    path = unfinished_path(target, _UNFINISHED.format(pid=os.getpid()))
    try:
        _clear_away(target)
        yield path
    except StorageError as error:
        path.unlink(missing_ok=True)
        why = error.said.values.get("why")
        if why is None:
            raise
        raise StorageError(f"{target}: {why}; nothing of the new log is left") from error
    except OSError as error:
        path.unlink(missing_ok=True)
        raise StorageError(f"{target}: {error.strerror}; look at `dmesg`, write to another disk") from error
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    kept = f"the new log is whole, and stays in {path}: give it another name by mv"
    try:
        if replace:
            path.replace(target)
        else:
            give_name(path, target)
    except FileExistsError:
        raise BadInputError(f"{target}: exists already and is never overwritten; {kept}") from None
    except OSError as error:
        raise StorageError(f"{target}: cannot be made ({error.strerror}); {kept}") from error
    try:
        sync(target.parent)
    except OSError as error:
        text = f"{target}: may not survive a loss of power ({error.strerror}); look at `dmesg`, copy it to another disk"
        raise StorageError(text) from error


def _clear_away(target: Path) -> None:
    """Remove what a process left that was killed; a log that is whole stays."""
    for left in target.parent.iterdir():
        pid = _PROCESS.search(left.name)
        if pid is None or left != unfinished_path(target, _UNFINISHED.format(pid=pid[1])):
            continue
        if not Path("/proc", pid[1]).exists() and not _is_whole(left):
            left.unlink(missing_ok=True)


def _is_whole(log: Path) -> bool:
    """Whether a log was closed. What cannot be read may be."""
    try:
        window = FileWindow(log, direct=False)
    except BadInputError:
        return True
    try:
        return is_closed(window)
    finally:
        window.close()
