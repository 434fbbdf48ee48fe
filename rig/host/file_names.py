"""The names of a file: the one under which it is written, the one that it gets when it is whole, ids of recordings."""

import ctypes
import errno
import os
import re
import zlib
from pathlib import Path
from typing import Final

#: Longest name of a file, bytes (linux/limits.h).
NAME_MAX: Final = 255
#: What no id holds: control characters, soft hyphens, marks without width or that turn the direction, no-characters.
_UNSEEN: Final = r"\u00ad\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff0-\uffff"
#: What the id of a recording looks like, for Python, Rust and JavaScript: it begins with a letter or digit, and holds
#: no character that ends a part of an address, is forbidden by Windows, or is invisible.
ID_PATTERN: Final = (
    rf"[^\u0000-/:-@\[-`{{-\u00a0{_UNSEEN}]" rf'[^\u0000-\u001f"*/:<>?\\|\u007f-\u00a0{_UNSEEN}]{{0,99}}'
)
#: Files beside a log have longer names.
ID_BYTES_MAX: Final = 220
_ID: Final = re.compile(ID_PATTERN)
_AT_FDCWD, _RENAME_NOREPLACE = -100, 1  # linux/fcntl.h, linux/fs.h


def is_recording_id(name: str) -> bool:
    """Whether a recording may have this id: the name of its log without the suffix."""
    try:
        return _ID.fullmatch(name) is not None and len(name.encode()) <= ID_BYTES_MAX
    except UnicodeEncodeError:  # no UTF-8 on the disk: no address can hold it
        return False


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
