"""What changes when a file does."""

import os
from contextlib import suppress
from pathlib import Path

#: Inode, size, times of the last write and of the last change to its inode.
FileKey = tuple[int, int, int, int]


def file_key(stat: os.stat_result) -> FileKey:
    """The key of a file of this status, or of a link itself."""
    return stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns


def key_of(path: Path | str) -> FileKey | None:
    """The key of the file at a path; None if there is none, or it cannot be looked at."""
    with suppress(OSError):
        return file_key(os.lstat(path))
    return None
