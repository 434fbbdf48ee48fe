"""What the disk below a file or directory offers: free room, direct I/O (past the page cache), files renewed whole."""

import errno
import fcntl
import os
import stat
from contextlib import suppress
from pathlib import Path

from rig.host.file_names import unfinished_path


def ask_free_bytes(place: Path | int) -> int:
    """Bytes that we may still write on the disk of a directory or an open file.

    The blocks that a file system keeps for root do not count.

    Args:
        place: the directory, or the descriptor of the file.

    Raises:
        OSError: the disk does not say.
    """
    disk = os.statvfs(place)
    return disk.f_bavail * disk.f_frsize


def free_bytes(place: Path | int) -> int | None:
    """As `ask_free_bytes`; None while the directory is not there (an unplugged disk, say)."""
    try:
        return ask_free_bytes(place)
    except OSError:
        return None


def replace_file(path: Path, content: bytes, *, links: bool) -> None:
    """Write a file, or renew it: whoever reads it, also after a power cut, finds the old content or the new one.

    A file that was there keeps its permissions, and its owner and group as far as this user may give files to them.

    Args:
        path: of the file.
        content: of the file.
        links: whether the file that a link points to is renewed; otherwise the file takes the place of the link.

    Raises:
        OSError: it cannot be written; then it is as it was.
    """
    if links:
        path = path.resolve()
    new = unfinished_path(path, ".new")
    try:
        new.unlink(missing_ok=True)
        with new.open("xb") as file:
            with suppress(FileNotFoundError):
                if stat.S_ISREG((before := path.lstat()).st_mode):
                    _take_rights(file.fileno(), before)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        new.replace(path)
        sync(path.parent)  # a file system that keeps a journal writes names seconds later
    except OSError:
        new.unlink(missing_ok=True)
        raise


def sync(path: Path) -> None:
    """Have the disk take a file, or the names in a folder; links are not followed.

    Raises:
        OSError: it refuses.
    """
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _take_rights(descriptor: int, of: os.stat_result) -> None:
    """Give an open file the rights of another; owner and group first, because a change of these takes rights away."""
    for owner, group in ((of.st_uid, -1), (-1, of.st_gid)):
        with suppress(PermissionError):  # root alone gives files away; others give them to their own groups
            os.fchown(descriptor, owner, group)
    os.fchmod(descriptor, of.st_mode & 0o777)


def set_direct(descriptor: int, *, wanted: bool) -> bool:
    """Switch direct I/O of an open file on or off.

    Returns:
        Whether it is on now; a file system without it says no.

    Raises:
        OSError: the switch failed for another reason.
    """
    flags = fcntl.fcntl(descriptor, fcntl.F_GETFL)
    try:
        fcntl.fcntl(descriptor, fcntl.F_SETFL, flags | os.O_DIRECT if wanted else flags & ~os.O_DIRECT)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        return False
    return wanted
