"""The trash of a folder of recordings: what lies in it, how much room it takes, what is removed from it for good."""

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from stat import S_ISDIR
from typing import Final

from recorder.catalogue.entry import SUFFIX
from recorder.catalogue.voice_notes import voice_folder
from recorder.log.beside import digitized_path, jumper_path, measured_path, survey_path, truth_path
from recorder.log.session_changes import session_path
from rig.host.files import opened_folder

_NAME: Final = ".trash"
_BLOCK: Final = 512  # unit of st_blocks, whatever the file system (stat(2))


@dataclass(frozen=True, slots=True)
class TrashedLog:
    """A log in the trash.

    Attributes:
        path: the log.
        bytes: room on the disk that becomes free when it is removed, with the files beside it.
        since: when it was put there, UNIX time, s.
    """

    path: Path
    bytes: int
    since: float


@dataclass(frozen=True, slots=True)
class TrashContents:
    """What lies in the trash.

    Attributes:
        recordings: number of logs.
        bytes: room on the disk that becomes free when the trash is emptied.
    """

    recordings: int
    bytes: int


def trash_of(directory: Path) -> Path:
    """Path of the trash of a folder of recordings."""
    return directory / _NAME


def trashed_logs(directory: Path) -> list[TrashedLog]:
    """The logs in the trash of a folder, the one that was deleted first at the front.

    Folders of such a name are left out: svev makes none, so nobody knows what is in them.

    Raises:
        OSError: the trash is there and cannot be read, or is a link.
    """
    trash = trash_of(directory)
    try:
        with opened_folder(trash) as folder, os.scandir(folder) as found:
            logs = [log for each in found if each.name.endswith(SUFFIX) and (log := _trashed(trash / each.name))]
    except FileNotFoundError:
        return []
    return sorted(logs, key=lambda log: (log.since, log.path.name))


def trash_contents(directory: Path) -> TrashContents:
    """How much lies in the trash of a folder; nothing if the trash cannot be read."""
    try:
        logs = trashed_logs(directory)
    except OSError:
        return TrashContents(0, 0)
    return TrashContents(len(logs), sum(log.bytes for log in logs))


def remove_for_good(log: TrashedLog) -> None:
    """Remove a log of the trash and the files beside it.

    Raises:
        OSError: the disk refuses, or the trash has become a link.
    """
    with opened_folder(log.path.parent) as trash:
        for path in (log.path, *beside(log.path)):
            with suppress(FileNotFoundError):
                if S_ISDIR(os.lstat(path.name, dir_fd=trash).st_mode):
                    shutil.rmtree(path.name, dir_fd=trash)
                else:
                    os.unlink(path.name, dir_fd=trash)


def oldest_until(logs: Iterable[TrashedLog], wanted_bytes: float) -> Iterator[TrashedLog]:
    """The first logs whose removal gives so much room; all of them if they give less."""
    for log in logs:
        if wanted_bytes <= 0:
            return
        wanted_bytes -= log.bytes
        yield log


def beside(log: Path) -> tuple[Path, ...]:
    """The files and folders that belong to a log, whether they are there or not."""
    parts = (session_path, truth_path, survey_path, jumper_path, measured_path, digitized_path, voice_folder)
    return tuple(part(log) for part in parts)


def _trashed(path: Path) -> TrashedLog | None:
    """The log at a path; None if it has just gone, or is a folder."""
    try:
        stat = path.lstat()
    except FileNotFoundError:
        return None
    if S_ISDIR(stat.st_mode):
        return None
    # Nobody writes into a deleted log, so its inode changed last when it was moved here.
    return TrashedLog(path, _freed(path) + sum(map(_freed, beside(path))), stat.st_ctime)


def _freed(path: Path) -> int:
    """Room that the removal of a file or folder gives; none for a file that has another name elsewhere."""
    try:
        stat = path.lstat()
        if S_ISDIR(stat.st_mode):
            return stat.st_blocks * _BLOCK + sum(map(_freed, path.iterdir()))
    except OSError:
        return 0
    return stat.st_blocks * _BLOCK if stat.st_nlink == 1 else 0
