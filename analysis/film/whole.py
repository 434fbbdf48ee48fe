"""Writes a file or a folder whole or not at all: beside its place first, then under its name."""

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from av.error import FFmpegError

from rig.errors import BadInputError, StorageError
from rig.host.disk import sync
from rig.host.file_names import unfinished_path
from rig.phrase import phrase

#: What the disk refuses although the place is right: full, quota used up, file too large, hardware error.
_DISK: Final = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO})
_UNFINISHED: Final = ".part"


@contextmanager
def whole_file(out: Path) -> Iterator[Path]:
    """Give a path to write a file to; it takes the place of `out` when it is complete, and is removed otherwise.

    Raises:
        StorageError: the disk is full or fails.
        BadInputError: `out` cannot be written.
    """
    part = unfinished_path(out, _UNFINISHED)
    try:
        with _in_one_line(out):
            yield part
            with part.open("rb") as written:
                os.fsync(written.fileno())
            part.replace(out)
            sync(out.parent)
    finally:
        with suppress(OSError):  # gone, if it has taken its place; the error of the disk, if any, is told above
            part.unlink()


@contextmanager
def whole_folder(out: Path) -> Iterator[Path]:
    """Give a folder to write into; it takes the place of `out` when it is complete, and is removed otherwise.

    Raises:
        StorageError: the disk is full or fails.
        BadInputError: `out` cannot be written, or is there already with something in it.
    """
    if out.is_dir() and any(out.iterdir()):
        raise BadInputError(
            phrase("export_folder_full", "{path}: holds files already; name a new folder", path=str(out))
        )
    part = unfinished_path(out, _UNFINISHED)
    try:
        with _in_one_line(out):
            shutil.rmtree(part, ignore_errors=True)  # of a program that was killed
            part.mkdir()
            yield part
            for made in part.iterdir():
                sync(made)
            part.replace(out)
            sync(out.parent)
    finally:
        shutil.rmtree(part, ignore_errors=True)


@contextmanager
def _in_one_line(out: Path) -> Iterator[None]:
    """Say what the disk refused."""
    try:
        yield
    except (FFmpegError, OSError) as error:
        if error.errno in {errno.ENOSPC, errno.EDQUOT}:
            raise StorageError(
                phrase(
                    "export_disk_full",
                    "{path}: the disk is full: make room on it or write to another one",
                    path=str(out),
                )
            ) from None
        if error.errno in _DISK:
            raise StorageError(
                phrase(
                    "export_disk_refuses",
                    "{path}: the disk refuses ({why}): write to another one",
                    path=str(out),
                    why=error.strerror or str(error),
                )
            ) from None
        raise BadInputError(
            phrase(
                "export_unwritable",
                "{path}: cannot be written ({why}); choose another place",
                path=str(out),
                why=error.strerror or str(error),
            )
        ) from None
