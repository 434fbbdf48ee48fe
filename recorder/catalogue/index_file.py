"""Keeps what was read from logs in one file beside them, so that a new service need not read them all again.

The file is believed as a whole or not at all: if it is one of this program's version, owned by this process's user,
writable by nobody else, and its checksum is right. A row is believed if its log is still the file that was read.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Final

from isal.isal_zlib import crc32

from recorder.catalogue.entry import SUFFIX, Entry
from rig.host.files import read_own
from rig.transport import wire

NAME: Final = ".svev-catalogue"
#: Some 100 000 rows; a larger file was not written by us.
_BYTES_MAX: Final = 64 << 20

#: What changes when a file does: inode, size, times of the last write and of the last change to its inode.
FileKey = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class KeptEntry:
    """What reading a log gave.

    Attributes:
        key: of the log's file when it was read.
        entry: without the changes of its session.
    """

    key: FileKey
    entry: Entry


def file_key(stat: os.stat_result) -> FileKey:
    """The key of a file of this status, or of a link itself."""
    return stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns


def load_kept(directory: Path) -> dict[str, KeptEntry]:
    """The entries that were kept in a directory, by path below it; none if the file is missing, or not believed."""
    try:
        text = read_own(directory / NAME, _BYTES_MAX)
    except OSError:
        return {}
    head, _, rows = text.partition(b"\n")
    if head != _head(rows):
        return {}
    try:
        kept = _DECODER.decode(rows)
    except ValueError:
        return {}
    return {
        name: each for name, each in kept.items()
        if name.rpartition("/")[2] == each.entry.id + SUFFIX and each.entry.bytes == each.key[1]
    }  # fmt: skip


def keep(directory: Path, entries: Mapping[str, KeptEntry]) -> None:
    """Replace the kept entries of a directory, by one rename.

    A directory that cannot be written keeps none: then the next service reads its logs again, which takes longer.
    """
    rows = wire.encode(entries)
    new = directory / f"{NAME}.new"
    try:
        new.unlink(missing_ok=True)
        with open(os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600), "wb") as file:  # noqa: PTH123
            file.write(_head(rows) + b"\n" + rows)
        new.replace(directory / NAME)
    except OSError:
        return


def _head(rows: bytes) -> bytes:
    return f"svev catalogue, version {version('svev')}.{_FORMAT}, checksum {crc32(rows):08x}".encode()


#: Counts up when entries of the same log become different ones.
_FORMAT: Final = 5
_DECODER: Final = wire.decoder(dict[str, KeptEntry])
