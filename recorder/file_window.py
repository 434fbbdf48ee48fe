"""Reads a file through one reusable window: no memory beyond the longest record, no page cache for long reads."""

import errno
import mmap
import os
from pathlib import Path

from recorder.direct_io import set_direct
from recorder.mcap_layout import PAGE, round_up
from rig.errors import BadInputError

#: Read on behind what was asked for, so that the head of the next record is there too.
_READ_ON = 4 * PAGE


class FileWindow:
    """Random access to a file; what `read` returns is valid until the next `read`.

    Attributes:
        path: the file.
        size: its size when it was opened, in bytes.
    """

    def __init__(self, path: Path, *, direct: bool) -> None:
        """Open the file.

        Args:
            path: the file.
            direct: read past the page cache, where the file system can: cheaper for long reads in order.

        Raises:
            BadInputError: it is missing, no file, or may not be read.
        """
        try:
            self._fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
        except FileNotFoundError:
            raise BadInputError(f"{path}: no such file; name an existing log") from None
        except OSError as error:
            raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
        if not os.path.isfile(self._fd):  # noqa: PTH113  # of the open file, not of whatever the name is by now
            os.close(self._fd)
            raise BadInputError(f"{path}: is no file; name a log")
        self.path = path
        self.size = os.fstat(self._fd).st_size
        self._begin = self._end = 0
        self._buffer = self._allocate(_READ_ON)
        if direct:
            set_direct(self._fd, wanted=True)

    def read(self, offset: int, length: int) -> memoryview:
        """The bytes from `offset` on, fewer than `length` only at the end of the file.

        Raises:
            BadInputError: the disk cannot read them.
        """
        if offset < self._begin or offset + length > self._end:
            self._fill(offset, length)
        first = offset - self._begin
        return self._view[first : max(first, min(first + length, self._end - self._begin))]

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def _fill(self, offset: int, length: int) -> None:
        begin = offset - offset % PAGE
        wanted = round_up(offset + length + _READ_ON - begin)
        if wanted > len(self._buffer):
            self._buffer = self._allocate(wanted)
        self._begin = self._end = begin
        while self._end - begin < wanted:
            got = self._read_into(self._view[self._end - begin : wanted], self._end)
            self._end += got
            if got == 0 or got % PAGE:
                break

    def _read_into(self, view: memoryview, offset: int) -> int:
        try:
            return os.preadv(self._fd, [view], offset)
        except OSError as error:
            if error.errno == errno.EINVAL:  # some file systems accept direct I/O and then refuse it
                set_direct(self._fd, wanted=False)
                try:
                    return os.preadv(self._fd, [view], offset)
                except OSError as second:
                    error = second
            raise BadInputError(
                f"{self.path}: cannot be read at byte {offset} ({error.strerror}); look at `dmesg`"
            ) from error

    def _allocate(self, size: int) -> mmap.mmap:
        buffer = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        if hasattr(mmap, "MADV_HUGEPAGE"):
            buffer.madvise(mmap.MADV_HUGEPAGE)
        self._view = memoryview(buffer)
        return buffer
