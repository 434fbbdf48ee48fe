"""Direct I/O (past the page cache), where a file system has it."""

import errno
import fcntl
import os


def set_direct(descriptor: int, *, wanted: bool) -> bool:
    """Switch direct I/O of an open file on or off.

    Returns:
        Whether it is on now; a file system without it says no.
    """
    flags = fcntl.fcntl(descriptor, fcntl.F_GETFL)
    try:
        fcntl.fcntl(descriptor, fcntl.F_SETFL, flags | os.O_DIRECT if wanted else flags & ~os.O_DIRECT)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        return False
    return wanted
