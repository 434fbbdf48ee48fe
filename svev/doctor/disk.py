"""Examines the disk: can the folder of the recordings be written, how fast, and how much fits on it?"""

import errno
import mmap
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from rig.host.disk import free_bytes, set_direct
from rig.phrase import phrase
from rig.settings.model import RigSettings
from service.recordings.storage import bytes_per_s, room_for
from svev.doctor.finding import Finding, Level, Topic, failure, judged, passed, warning

_MB = 1_000_000
_GB = 1_000_000_000
_BLOCK = 8 << 20
_TRIAL = 256 << 20
_LONGEST_S = 4.0  # a slow disk is judged by what it wrote in this time
_HEADROOM = 1.5  # speed wanted over speed needed, because disks stall
_ENOUGH_MIN = 10.0


@dataclass(frozen=True, slots=True)
class Trial:
    """Results of writing to the disk and reading back.

    Attributes:
        direct: whether the file system takes direct I/O.
        write_bps: bytes written per second.
        read_bps: bytes read back per second.
        same: whether the bytes read back are those that were written.
    """

    direct: bool
    write_bps: float
    read_bps: float
    same: bool


def existing_part(directory: Path) -> Path:
    """The directory itself, or the nearest parent that exists: a recording makes the missing part."""
    path = directory.absolute()
    while not path.exists() and path != path.parent:
        path = path.parent
    return path


def look_at_disk(rig: RigSettings, directory: Path) -> Iterator[Finding]:
    """Write a file of up to 256 MB into the folder of the recordings, read it back and remove it."""
    place = existing_part(directory)
    try:
        with _unnamed_file(place) as fd:
            yield passed(Topic.DISK, "check_disk_writable", "{folder} can be written", folder=str(directory))
            free = free_bytes(fd) or 0
            yield look_at_room(rig, directory, free)
            if free < 2 * _TRIAL:
                return
            yield from judge_trial(rig, directory, try_disk(fd))
    except OSError as error:
        yield failure(
            Topic.DISK,
            "check_disk_not_writable",
            "{folder} cannot be written: {why}",
            "correct its permissions, or choose another recorder.directory or --out",
            folder=str(directory),
            why=error.strerror or str(error),
        )


def look_at_room(rig: RigSettings, directory: Path, free: int) -> Finding:
    """How long a recording fits into `free` bytes, with the reserve kept."""
    room = room_for(rig, free)
    minutes = room.seconds / 60
    said = phrase(
        "check_room",
        "{gb:.1f} GB free in {folder}: {minutes:.0f} min of recording, {jumps} jumps of {jump_s:g} s",
        gb=free / _GB, folder=str(directory), minutes=minutes, jumps=room.jumps, jump_s=rig.recorder.jump_s,
    )  # fmt: skip
    remedy = "remove old recordings, or choose another disk with recorder.directory or --out"
    level = Level.FAIL if room.jumps < 1 else Level.PASS if minutes >= _ENOUGH_MIN else Level.WARN
    return judged(level, Topic.DISK, said, remedy)


def look_at_other_disks(rig: RigSettings, directory: Path) -> Iterator[Finding]:
    """Can the folders be written in which a recording goes on, or is copied, and are they on other disks?"""
    if rig.recorder.fallback_directory is not None:
        yield from _look_at_other_disk(rig.recorder.fallback_directory, "recorder.fallback_directory", directory)
    if rig.offload is not None and rig.offload.to is not None:
        yield from _look_at_other_disk(rig.offload.to, "offload.to", directory)


def _look_at_other_disk(folder: Path, setting: str, directory: Path) -> Iterator[Finding]:
    place = existing_part(folder)
    try:
        with _unnamed_file(place) as fd:
            free = free_bytes(fd) or 0
    except OSError as error:
        yield failure(
            Topic.DISK,
            "check_other_disk_not_writable",
            "{folder} ({setting}) cannot be written: {why}",
            "correct its permissions; under systemd allow it: sudo systemctl edit svev, [Service] ReadWritePaths=",
            folder=str(folder),
            setting=setting,
            why=error.strerror or str(error),
        )
        return
    if place.stat().st_dev == existing_part(directory).stat().st_dev:
        yield warning(
            Topic.DISK,
            "check_other_disk_same",
            "{folder} ({setting}) is on the same disk as {first}",
            "choose a folder on another disk, and check that this one is mounted",
            folder=str(folder),
            setting=setting,
            first=str(directory),
        )
    else:
        what = "{gb:.1f} GB free in {folder} ({setting})"
        yield passed(Topic.DISK, "check_other_disk", what, gb=free / _GB, folder=str(folder), setting=setting)


def judge_trial(rig: RigSettings, directory: Path, trial: Trial) -> Iterator[Finding]:
    """Judge the results of a trial by what this rig needs."""
    if not trial.same:
        yield failure(
            Topic.DISK,
            "check_disk_forgets",
            "{folder} does not give back what was written",
            "the disk is failing: look at `dmesg`, replace it",
            folder=str(directory),
        )
    if not trial.direct:
        yield warning(
            Topic.DISK,
            "check_no_direct_io",
            "the file system of {folder} has no direct I/O: recording costs several times the processor time",
            "record to ext4 or xfs on a local disk",
            folder=str(directory),
        )
    needed = bytes_per_s(rig)
    said = phrase(
        "check_disk_speed",
        "the disk writes {writes:.0f} and reads {reads:.0f} MB/s, {needed:.0f} MB/s are needed",
        writes=trial.write_bps / _MB, reads=trial.read_bps / _MB, needed=needed / _MB,
    )  # fmt: skip
    remedy = "record to a faster disk (NVMe), or lower trigger.rate_hz or the regions"
    enough, ample = trial.write_bps >= needed, trial.write_bps >= _HEADROOM * needed
    yield judged(Level.PASS if ample else Level.WARN if enough else Level.FAIL, Topic.DISK, said, remedy)


def try_disk(fd: int, size: int = _TRIAL) -> Trial:
    """Write up to `size` bytes past the page cache, read them back.

    Raises:
        OSError: the disk refuses.
    """
    with mmap.mmap(-1, _BLOCK) as pattern, mmap.mmap(-1, _BLOCK) as back:
        pattern.write(os.urandom(_BLOCK))  # random bytes, which no file system can compress
        direct = _take_direct(fd, pattern)
        begin = time.monotonic()
        written = 0
        while written < size and time.monotonic() - begin < _LONGEST_S:
            if os.pwrite(fd, pattern, written) < _BLOCK:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            written += _BLOCK
        os.fdatasync(fd)
        middle = time.monotonic()
        same, place = True, 0
        while place < written and time.monotonic() - middle < _LONGEST_S:
            same = os.preadv(fd, [back], place) == _BLOCK and back[:] == pattern[:] and same
            place += _BLOCK
        end = time.monotonic()
    return Trial(direct, written / (middle - begin), place / (end - middle), same)


@contextmanager
def _unnamed_file(directory: Path) -> Iterator[int]:
    """A file without a name, which disappears however this program ends."""
    fd, name = tempfile.mkstemp(prefix=".svev-doctor-", dir=directory)
    Path(name).unlink()
    try:
        yield fd
    finally:
        os.close(fd)


def _take_direct(fd: int, block: mmap.mmap) -> bool:
    """Switch direct I/O on, and say whether the file system supports it (some refuse only the first write)."""
    if not set_direct(fd, wanted=True):
        return False
    try:
        os.pwrite(fd, block, 0)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        return set_direct(fd, wanted=False)
    return True
