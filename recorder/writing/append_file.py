"""Appends to a new file: past the page cache where the file system can, each write whole or an error."""

import errno
import mmap
import os
from pathlib import Path

from recorder.log.mcap_layout import PAGE
from recorder.log.write_lock import mark_as_written
from rig.errors import BadInputError, FileVanishedError, NameTakenError, StorageError
from rig.host.disk import ask_free_bytes, set_direct
from rig.phrase import phrase

_REMEDIES = {
    errno.ENOSPC: phrase("disk_full", "the disk is full: make room on it or record to another one"),
    errno.EDQUOT: phrase("disk_quota", "your disk quota is used up: make room or record to another disk"),
    errno.EFBIG: phrase(
        "disk_file_limit",
        "the file has reached the size limit: raise `ulimit -f`, or record to a file system without one",
    ),
    errno.EROFS: phrase(
        "disk_read_only", "the file system has become read-only: look at `dmesg`, then record to another disk"
    ),
    errno.EIO: phrase("disk_fails", "the disk fails: look at `dmesg` and its cable, and record to another disk"),
}


def storage_error(path: Path, error: OSError) -> StorageError:
    """The operating system's error as a StorageError that says what to do."""
    other = "{system}: look at `dmesg`, then record to another disk"
    why = _REMEDIES.get(error.errno or 0) or phrase("disk_refuses", other, system=error.strerror or str(error))
    text = "{path}: {why}; what is written so far stays readable"
    return StorageError(phrase("why_disk_refuses", text, path=str(path), why=why))


class AppendFile:
    """A new file that only grows, written in whole pages from page-aligned memory, and marked as being written.

    Attributes:
        path: the file.
        direct: whether writes go past the page cache.
        size: bytes of all writes that were completed.
    """

    def __init__(self, path: Path):
        """Create the file.

        Raises:
            NameTakenError: the file exists already.
            BadInputError: its directory is missing or not writable.
            StorageError: the disk refuses.
        """
        self.path = path
        self.size = 0
        flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC
        try:
            self._fd = os.open(path, flags, 0o644)
        except FileExistsError:
            raise NameTakenError(f"{path}: exists already and is never overwritten; choose another name") from None
        except FileNotFoundError:
            raise BadInputError(f"{path.parent}: no such directory; make it, or choose another one") from None
        except (PermissionError, NotADirectoryError, IsADirectoryError) as error:
            raise BadInputError(
                f"{path}: cannot be made ({error.strerror}); choose a directory you may write to"
            ) from None
        except OSError as error:
            raise storage_error(path, error) from error
        try:
            mark_as_written(self._fd)
        except OSError as error:
            self.discard()
            raise storage_error(path, error) from error
        self.direct = set_direct(self._fd, wanted=True)

    def append(self, pages: memoryview | mmap.mmap) -> None:
        """Write whole pages at the end.

        Raises:
            OSError: the disk refuses; `size` is unchanged, and the file may have a torn end that `cut` removes.
        """
        done = 0
        with memoryview(pages) as view:
            while done < len(view):
                written = self._write(view[done:], self.size + done)
                if self.direct:  # a short write may end anywhere, but the next one must start on a page
                    written -= written % PAGE
                if written == 0:
                    raise OSError(errno.EIO, "the disk took nothing")
                done += written
        self.size += done

    def sync(self) -> None:
        """Make everything appended so far survive a power loss, the file's size included.

        Raises:
            OSError: the disk refuses.
        """
        os.fdatasync(self._fd)

    def cut(self) -> None:
        """Remove what a failed write left at the end.

        Raises:
            OSError: the disk refuses.
        """
        os.ftruncate(self._fd, self.size)

    def finish(self, rest: bytes) -> None:
        """Append the last bytes, of any length, and make file and directory entry durable.

        Raises:
            OSError: the disk refuses; `size` is unchanged.
        """
        set_direct(self._fd, wanted=False)
        done = 0
        while done < len(rest):
            written = os.pwrite(self._fd, rest[done:], self.size + done)
            if written == 0:
                raise OSError(errno.EIO, "the disk took nothing")
            done += written
        self.sync_entry()
        self.size += done

    def sync_entry(self) -> None:
        """Make the file and its name in the directory survive a power loss.

        Raises:
            OSError: the disk refuses.
        """
        os.fsync(self._fd)
        directory = os.open(self.path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(directory)
        finally:
            os.close(directory)

    def look(self) -> int:
        """Check that the file is still in its place.

        Returns:
            Room left on the disk for us, in bytes.

        Raises:
            FileVanishedError: the file was deleted or moved away, or its folder was.
            OSError: the disk does not say.
        """
        own = os.fstat(self._fd)
        try:
            there = os.stat(self.path)  # noqa: PTH116 - both the same call
        except FileNotFoundError:
            there = None
        if there is None or (there.st_dev, there.st_ino) != (own.st_dev, own.st_ino):
            path = str(self.path)
            if own.st_nlink == 0:
                text = "{path}: was deleted while it was recorded; leave the folder of the recordings alone meanwhile"
                raise FileVanishedError(phrase("why_deleted", text, path=path))
            text = "{path}: was moved away while it was recorded; leave the folder of the recordings alone meanwhile"
            raise FileVanishedError(phrase("why_moved_away", text, path=path))
        return ask_free_bytes(self._fd)

    def discard(self) -> None:
        """Close and remove the file."""
        self.close()
        self.path.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def _write(self, view: memoryview, offset: int) -> int:
        try:
            return os.pwrite(self._fd, view, offset)
        except OSError as error:
            # Some file systems accept the switch to direct I/O and refuse the write.
            if error.errno != errno.EINVAL or not self.direct:
                raise
            self.direct = set_direct(self._fd, wanted=False)
            return os.pwrite(self._fd, view, offset)
