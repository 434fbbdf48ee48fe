"""Copies a file so that a copy that broke off is gone on with, and none counts that was not read back from its disk."""

import hashlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO, Final

from rig.errors import StorageError
from rig.host.files import open_to_read

_PIECE: Final = 1 << 22
#: Ending of the file with the checksum of a copied log, beside it.
SUM: Final = ".sha256"
#: Bytes that wait in memory for the other disk: few, so that memory and disks stay free for a recording.
_SYNC: Final = 1 << 26


def copy_file(source: Path, part: Path, told: Callable[[int], None]) -> str:
    """Copy a file.

    What stands under `part` already is gone on with as far as it agrees with the source.

    Args:
        source: the file.
        part: the copy in the making.
        told: called with the bytes of each piece, twice for each byte: when it is written, and when it is read back.
            While it does not return, the copy stands still.

    Returns:
        SHA-256 of the file, hexadecimal.

    Raises:
        StorageError: what was read back is not what was written; `part` is gone.
        OSError: a disk refuses; `part` stays for the next time.
    """
    part.touch()
    with open_to_read(source, links=False) as reader, part.open("r+b") as writer:
        digest = hashlib.sha256()
        for piece in _agreeing(reader, writer):
            digest.update(piece)
            told(len(piece))
        writer.truncate()
        unsynced = 0
        while piece := reader.read(_PIECE):
            writer.write(piece)
            digest.update(piece)
            unsynced += len(piece)
            if unsynced >= _SYNC:
                _sync(writer)
                unsynced = 0
            told(len(piece))
        _sync(writer)
    wanted = digest.hexdigest()
    if checksum(part, told) != wanted:
        part.unlink()
        raise StorageError(
            f"{part.parent}: what was read back of {source.name} is not what was written; take another disk"
        )
    return wanted


def sum_of(copy: Path) -> Path:
    """The file with the checksum of a copied log, beside it."""
    return copy.with_name(copy.name + SUM)


def sum_line(digest: str, name: str) -> bytes:
    """Its content, as `sha256sum --check` reads it."""
    return f"{digest}  {name}\n".encode()


def files_of(source: Path) -> list[Path]:
    """A file, or the files in a folder and below."""
    if not source.is_dir():
        return [source]
    return [path for path in sorted(source.rglob("*")) if path.is_file() and not path.is_symlink()]


def checksum(path: Path, told: Callable[[int], None]) -> str:
    """SHA-256 of a file, hexadecimal, read from its disk and not from memory.

    Raises:
        OSError: the disk refuses.
    """
    digest = hashlib.sha256()
    with open_to_read(path, links=False) as reader:
        os.posix_fadvise(reader.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
        while piece := reader.read(_PIECE):
            digest.update(piece)
            told(len(piece))
    return digest.hexdigest()


def _agreeing(reader: BinaryIO, writer: BinaryIO) -> Iterator[bytes]:
    """The pieces from the beginning that both files have; both stand behind the last of them afterwards."""
    while piece := writer.read(_PIECE):
        place = reader.tell()
        if reader.read(len(piece)) != piece:
            reader.seek(place)
            writer.seek(place)
            return
        yield piece


def _sync(writer: BinaryIO) -> None:
    writer.flush()
    os.fsync(writer.fileno())
