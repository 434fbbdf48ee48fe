"""The program that copies a log with all its files elsewhere, and reads both once more later.

A log counts as copied when it was read back from the other disk and its checksum stands beside it, in the form that
`sha256sum --check` reads.
"""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Final

from rig.background.messages import End
from rig.background.program import Teller, serve
from rig.errors import StorageError
from rig.host.disk import ask_free_bytes, replace_file, sync
from rig.phrase import phrase
from service.offloading.orders import Confirm, ConfirmUpload, Copy, TryStore, Upload
from service.offloading.uploading import confirm_upload, try_store, upload
from service.offloading.verified_copy import (
    another_log,
    bytes_of,
    changed_copy,
    checksum,
    copy_file,
    files_of,
    progress_of,
    sum_line,
    sum_of,
)

_LOG: Final = ".mcap"


def _copy(asked: Copy, tell: Teller) -> End:
    to = asked.to
    if not to.is_dir():
        text = "{folder}: the folder for copies is not there; connect its disk, and the copy is made"
        raise StorageError(phrase("copying_no_folder", text, folder=str(to)))
    if not os.access(to, os.W_OK | os.X_OK):
        text = (
            "{folder}: nothing can be written there; mount its disk writable, or give the folder to the user of the "
            "service (under systemd allow it by ReadWritePaths), and the copy is made"
        )
        raise StorageError(phrase("copying_not_writable", text, folder=str(to)))
    wanted = [source for source in asked.paths if source.exists() and not _is_copied(source, to / source.name)]
    size = bytes_of(wanted)
    there = sum(part.stat().st_size for source in wanted if (part := _part(source, to)).is_file())
    if ask_free_bytes(to) < size - there:
        raise StorageError(
            phrase(
                "copying_no_room",
                "{folder}: has not the {gb:.1f} GB free that the copy takes; make room there, and the copy is made",
                folder=str(to),
                gb=(size - there) / 1e9,
            )
        )
    told = progress_of(size, tell)
    for source in wanted:
        if source.suffix == _LOG and (to / source.name).exists():
            _accept(source, to / source.name, told)
        else:
            _copy_one(source, to, told)
    sync(to)
    return End()


def _confirm(asked: Confirm, _: Teller) -> End:
    wanted = sum_of(asked.copy).read_text().partition(" ")[0]
    for path in (asked.log, asked.copy):
        if checksum(path, lambda _: None) != wanted:
            sum_of(asked.copy).unlink()
            raise changed_copy(asked.copy)
    return End()


def _copy_one(source: Path, to: Path, told: Callable[[int], None]) -> None:
    """Copy a file or a folder; a folder is begun anew, since it is small and may have changed."""
    part, target = _part(source, to), to / source.name
    if part.is_dir():
        shutil.rmtree(part)
    digest = ""
    for path in files_of(source):
        copy = part / path.relative_to(source) if source.is_dir() else part
        copy.parent.mkdir(parents=True, exist_ok=True)
        digest = copy_file(path, copy, told)
        shutil.copystat(path, copy)
    if part.exists():
        _rename(part, target)
    if source.suffix == _LOG:
        _keep_sum(target, digest)


def _accept(source: Path, target: Path, told: Callable[[int], None]) -> None:
    """Compare a log with a copy that has no checksum beside it: of an earlier version, or of somebody else.

    Raises:
        StorageError: it is another log of this name.
    """
    digest = checksum(source, told)
    if checksum(target, told) != digest:
        raise another_log(target)
    _keep_sum(target, digest)


def _keep_sum(target: Path, digest: str) -> None:
    replace_file(sum_of(target), sum_line(digest, target.name), links=False)


def _is_copied(source: Path, target: Path) -> bool:
    """Whether a log is there, read back; results and notes are always copied anew.

    Raises:
        StorageError: another log of this name is there.
    """
    if source.suffix != _LOG or not target.exists():
        return False
    if source.stat().st_size != target.stat().st_size:
        raise another_log(target)
    return sum_of(target).exists()


def _part(source: Path, to: Path) -> Path:
    return to / f".{source.name}.part"


def _rename(part: Path, target: Path) -> None:
    """Give what was copied its name, in place of what had it."""
    if target.is_dir():
        shutil.rmtree(target)
    part.replace(target)


def main() -> None:
    """Copy, confirm a copy, or try a store."""
    serve({Copy: _copy, Confirm: _confirm, Upload: upload, ConfirmUpload: confirm_upload, TryStore: try_store})


if __name__ == "__main__":
    main()
