"""Marks a log in the making: its writer holds a lock on the file, which the kernel removes when the writer ends.

The lock is one of an open file description (`F_OFD_SETLK`, fcntl(2)): other threads and processes can ask for it
without taking it. A file system that knows no locks leaves its logs unmarked.
"""

import errno
import fcntl
import os
import struct
from pathlib import Path
from typing import Final

from rig.host.files import open_regular

#: `struct flock` of a 64-bit Linux: type, whence, start, length (0: to the end), process.
_FLOCK: Final = struct.Struct("hhqqi4x")
_UNKNOWN: Final = frozenset({errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL})


def mark_as_written(fd: int) -> None:
    """Hold the lock of a new file until its descriptor is closed.

    Raises:
        OSError: another program holds it.
    """
    try:
        fcntl.fcntl(fd, fcntl.F_OFD_SETLK, _FLOCK.pack(fcntl.F_WRLCK, os.SEEK_SET, 0, 0, 0))
    except OSError as error:
        if error.errno not in _UNKNOWN:
            raise


def is_being_written(log: Path) -> bool:
    """Whether a program is writing a log now. Links are not followed; what cannot be opened is not being written."""
    try:
        fd = open_regular(log, links=False)
    except OSError:
        return False
    try:
        asked = fcntl.fcntl(fd, fcntl.F_OFD_GETLK, _FLOCK.pack(fcntl.F_RDLCK, os.SEEK_SET, 0, 0, 0))
    except OSError:
        return False
    finally:
        os.close(fd)
    kind: int = _FLOCK.unpack(asked)[0]
    return kind != fcntl.F_UNLCK
