"""The names of a file: the one under which it is written, and the one that it gets when it is whole."""

import ctypes
import errno
import os
import zlib
from pathlib import Path
from typing import Final

#: Longest name of a file, bytes (linux/limits.h).
NAME_MAX: Final = 255
_AT_FDCWD, _RENAME_NOREPLACE = -100, 1  # linux/fcntl.h, linux/fs.h


def unfinished_path(path: Path, ending: str) -> Path:
    """The hidden path beside `path` under which a file is written until it is whole.

    Args:
        path: of the file when it is whole.
        ending: e.g. ".part"; a name that would be too long with it is cut, and differs from others by its checksum.
    """
    name = path.name
    if _length(f".{name}{ending}") > NAME_MAX:
        mark = f"~{zlib.crc32(os.fsencode(name)):08x}"
        while _length(f".{name}{mark}{ending}") > NAME_MAX:
            name = name[:-1]  # by characters: some file systems take no half ones
        name += mark
    return path.with_name(f".{name}{ending}")


def give_name(file: Path, name: Path) -> None:
    """Rename a file, also into another folder of the same disk, without ever replacing one.

    Not every file system can do that in one step: exFAT has no such renaming and no links, NFS has links only. Where
    both are missing, whoever makes a file of this name in the same instant loses it.

    Raises:
        FileExistsError: there is something of this name.
        OSError: the disk refuses; the file keeps its old name.
    """
    # What a file system cannot do, it refuses with almost any error: the last way tells why the disk refuses.
    try:
        _rename_exclusively(file, name)
    except FileExistsError:
        raise
    except OSError:
        _link_or_rename(file, name)


def _rename_exclusively(file: Path, name: Path) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.renameat2(_AT_FDCWD, os.fsencode(file), _AT_FDCWD, os.fsencode(name), _RENAME_NOREPLACE) < 0:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error), str(file), None, str(name))


def _link_or_rename(file: Path, name: Path) -> None:
    try:
        os.link(file, name, follow_symlinks=False)
    except FileExistsError:
        raise
    except OSError:
        if os.path.lexists(name):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(name)) from None
        file.rename(name)
    else:
        file.unlink()


def _length(name: str) -> int:
    return len(os.fsencode(name))
