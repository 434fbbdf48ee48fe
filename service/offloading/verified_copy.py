"""Copies a file so that an interrupted copy is continued, and only a copy that was read back from its disk counts."""

import hashlib
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, Final

from rig.api.measuring import MeasuringStep
from rig.background.messages import Progress
from rig.background.program import Teller
from rig.errors import StorageError
from rig.host.files import open_to_read
from rig.phrase import phrase

PIECE: Final = 1 << 22  #: bytes that are read at a time
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
        while piece := reader.read(PIECE):
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
    with open_to_read(path, links=False) as reader:
        os.posix_fadvise(reader.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
        return digest_of(reader, told)


def digest_of(reader: BinaryIO, told: Callable[[int], None]) -> str:
    """SHA-256 of what comes, hexadecimal.

    Args:
        reader: where it comes from.
        told: called with the bytes of each piece.
    """
    digest = hashlib.sha256()
    while piece := reader.read(PIECE):
        digest.update(piece)
        told(len(piece))
    return digest.hexdigest()


def bytes_of(sources: Iterable[Path]) -> int:
    """Size of files, and of the files in folders and below."""
    return sum(path.stat().st_size for source in sources for path in files_of(source))


def progress_of(size: int, tell: Teller) -> Callable[[int], None]:
    """Takes the bytes of each piece that is written or read back, and tells how far the copying of so many bytes is."""
    done = 0

    def told(count: int) -> None:
        nonlocal done
        done += count
        tell(Progress(step=MeasuringStep.COPYING, share=done / (2 * size)))

    return told


def another_log(target: object) -> StorageError:
    """Another log has the name of a copy."""
    text = "{path}: is another log of this name; move it away, and the copy is made"
    return StorageError(phrase("copying_other_log", text, path=str(target)))


def changed_copy(target: object) -> StorageError:
    """A copy, or its log, is not what was copied."""
    return StorageError(
        f"{target}: is not what was copied there any more; move it away, and the recording is copied again"
    )


def _agreeing(reader: BinaryIO, writer: BinaryIO) -> Iterator[bytes]:
    """The pieces from the beginning that both files have; both stand behind the last of them afterwards."""
    while piece := writer.read(PIECE):
        place = reader.tell()
        if reader.read(len(piece)) != piece:
            reader.seek(place)
            writer.seek(place)
            return
        yield piece


def _sync(writer: BinaryIO) -> None:
    writer.flush()
    os.fsync(writer.fileno())
