"""Says which files of a folder have changed since it was last asked, by the kernel's own account (inotify(7)).

Twenty thousand recordings with what lies beside them are eighty thousand files: to look at each of them takes longer
than a list may take.
"""

import ctypes
import os
import struct
import weakref
from pathlib import Path
from typing import Final

# From sys/inotify.h.
_ATTRIB: Final = 0x4
_CLOSE_WRITE: Final = 0x8
_MOVED: Final = 0x40 | 0x80
_CREATE: Final = 0x100
_DELETE: Final = 0x200
_SELF: Final = 0x400 | 0x800
_ONLY_A_FOLDER: Final = 0x0100_0000 | 0x0200_0000  # IN_ONLYDIR, IN_DONT_FOLLOW
_LOST: Final = 0x2000 | 0x4000 | 0x8000  # IN_UNMOUNT, IN_Q_OVERFLOW, IN_IGNORED
_HEAD: Final = struct.Struct("iIII")
_ROOM: Final = 1 << 16

_LIBC: Final = ctypes.CDLL(None, use_errno=True)


class FolderWatch:
    """Watches the names in one folder. Not safe to use from several threads at once.

    A file that is still being written is told when its writer closes it. Where the kernel cannot tell (no more watches
    to be had, a change made on another computer), everything counts as changed.

    Args:
        folder: it may be missing, and may become another one.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._descriptor = -1
        self._seen: tuple[int, int, int] | None = (
            None  # device and inode of the watched folder, time of its last change
        )
        self._close: weakref.finalize[..., FolderWatch] | None = None

    def changed(self) -> set[str] | None:
        """Names that have come, gone or changed since the last call; None: look at all of them.

        Raises:
            FileNotFoundError: there is no such folder.
            OSError: the folder cannot be looked at.
        """
        status = self._folder.stat()
        now = status.st_dev, status.st_ino, status.st_mtime_ns
        before, self._seen = self._seen, now
        if self._descriptor < 0 or before is None or before[:2] != now[:2]:
            self._begin()
            return None
        names = self._told()
        if names is None:
            self.forget()
            self._seen = now
            self._begin()
        elif not names and before[2] != now[2]:
            return None  # somebody else than this computer's kernel has changed it
        return names

    def forget(self) -> None:
        """Stop watching: at the next call everything counts as changed."""
        if self._close is not None:
            self._close()
        self._descriptor, self._close, self._seen = -1, None, None

    def _begin(self) -> None:
        """Begin to watch the folder, if the kernel lets us."""
        if self._close is not None:
            self._close()
            self._descriptor, self._close = -1, None
        descriptor = _LIBC.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
        if descriptor < 0:
            return
        wanted = _ATTRIB | _CLOSE_WRITE | _MOVED | _CREATE | _DELETE | _SELF | _ONLY_A_FOLDER
        if _LIBC.inotify_add_watch(descriptor, os.fsencode(self._folder), wanted) < 0:
            os.close(descriptor)
            return
        self._descriptor, self._close = descriptor, weakref.finalize(self, os.close, descriptor)

    def _told(self) -> set[str] | None:
        """What the kernel has told since it was last asked; None: something was lost."""
        names: set[str] = set()
        while True:
            try:
                told = os.read(self._descriptor, _ROOM)
            except BlockingIOError:
                return names
            place = 0
            while place < len(told):
                _, mask, _, length = _HEAD.unpack_from(told, place)
                place += _HEAD.size
                if mask & (_LOST | _SELF):
                    return None
                names.add(os.fsdecode(told[place : place + length].rstrip(b"\0")))
                place += length
