"""Opens files and folders that may be anything: a link, a pipe, a device, or a file of 200 GB under a known name.

Every file that somebody else may have put there is opened here. Nobody waits for a pipe, and no more is read than the
caller wants. In a folder of recordings links are not followed (`links=False`); what a person names may be a link.
"""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from io import BufferedReader
from pathlib import Path
from typing import Final

#: The largest text that a person gives to a command: a network, a survey, a result.
TEXT_MAX: Final = 100_000_000

_FLAGS: Final = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOCTTY


class UntrustedFileError(OSError):
    """What stands under a name is not what it should be; `strerror` says what it is, without what to do."""


def open_regular(path: Path, *, links: bool) -> int:
    """Open a regular file for reading.

    Args:
        path: of the file.
        links: whether a link of this name is followed.

    Returns:
        The descriptor.

    Raises:
        UntrustedFileError: it is a link that is not followed, a folder, a pipe, a socket or a device.
        OSError: it is missing, or may not be read.
    """
    try:
        descriptor = os.open(path, _FLAGS | (0 if links else os.O_NOFOLLOW))
    except OSError as error:
        raise _in_words(error, path, links=links) from None
    if stat.S_ISREG(os.fstat(descriptor).st_mode):
        return descriptor
    os.close(descriptor)
    raise _no_file(path)


def open_to_read(path: Path, *, links: bool) -> BufferedReader:
    """As `open_regular`, as a file object."""
    return os.fdopen(open_regular(path, links=links), "rb")


def read_whole(path: Path, most_bytes: int, *, links: bool) -> bytes:
    """The content of a regular file.

    Args:
        path: of the file.
        most_bytes: a larger one is refused.
        links: whether a link of this name is followed.

    Raises:
        UntrustedFileError: as `open_regular`; or it is larger.
        OSError: it is missing, or cannot be read.
    """
    with open_to_read(path, links=links) as file:
        return _read(file, most_bytes, path)


def read_own(path: Path, most_bytes: int) -> bytes:
    """As `read_whole` without links, of a file that nobody but this process's user can have written.

    Raises:
        UntrustedFileError: as `read_whole`; or it is another user's, or others may write it.
        OSError: it is missing, or cannot be read.
    """
    with open_to_read(path, links=False) as file:
        status = os.fstat(file.fileno())
        if status.st_uid != os.geteuid() or status.st_mode & 0o022:
            raise UntrustedFileError(errno.EPERM, "others may have written it", str(path))
        return _read(file, most_bytes, path)


@contextmanager
def opened_folder(path: Path) -> Iterator[int]:
    """A folder that is no link, open: by this descriptor its content is reached, whatever its name becomes meanwhile.

    Raises:
        UntrustedFileError: it is a link, or no folder.
        OSError: it is missing, or may not be read.
    """
    try:
        descriptor = os.open(path, _FLAGS | os.O_DIRECTORY | os.O_NOFOLLOW)
    except NotADirectoryError:
        raise _no_folder(path) from None
    except OSError as error:
        raise _in_words(error, path, links=False) from None
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def make_folder(path: Path) -> None:
    """Make a folder, unless it is there.

    Raises:
        UntrustedFileError: something else, such as a link, has its name.
        OSError: it cannot be made.
    """
    try:
        path.mkdir()
    except FileExistsError:
        with opened_folder(path):
            return


def _read(file: BufferedReader, most_bytes: int, path: Path) -> bytes:
    # The size that the disk gives is not enough: the file may grow, and those of /proc have none.
    content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise UntrustedFileError(errno.EFBIG, f"is larger than {_size(most_bytes)}", str(path))
    return content


def _in_words(error: OSError, path: Path, *, links: bool) -> OSError:
    if error.errno == errno.ELOOP and not links:
        return UntrustedFileError(errno.ELOOP, "is a link, and links are not followed", str(path))
    if error.errno == errno.ENXIO:  # a socket
        return _no_file(path)
    return error


def _no_file(path: Path) -> OSError:
    if path.is_dir():
        return UntrustedFileError(errno.EISDIR, "is a folder", str(path))
    return UntrustedFileError(errno.EINVAL, "is no file, but a device or a pipe", str(path))


def _no_folder(path: Path) -> OSError:
    text = "is a link, and links are not followed" if path.is_symlink() else "is no folder"
    return UntrustedFileError(errno.ENOTDIR, text, str(path))


def _size(size: int) -> str:
    """A number of bytes for people."""
    return f"{size // 1_000_000} MB" if size >= 1_000_000 else f"{size >> 10} KiB"
