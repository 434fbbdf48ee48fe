"""One program of this computer records into a folder, and the next one hears which."""

import errno
import fcntl
import os
import stat
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from rig.errors import BadInputError
from svev.claims import LOCK, folder_claim, folder_claims


def serve_claim(data: Path) -> AbstractContextManager[None]:
    return folder_claim(data, "svev serve", "--data")


def record_claim(data: Path) -> AbstractContextManager[None]:
    return folder_claim(data, "svev record", "--out")


def test_a_directory_has_one_program_that_records(tmp_path: Path) -> None:
    data = tmp_path / "new" / "data"
    holder = rf"another svev serve \(process {os.getpid()}\)"
    said = rf"{data}: {holder} uses it: record with it \(svev ctl start\), or choose another --out"
    with serve_claim(data), pytest.raises(BadInputError, match=said), record_claim(data):
        pass
    with record_claim(data), pytest.raises(BadInputError, match=r"another svev record .*, or choose another --data"):
        serve_claim(data).__enter__()
    with serve_claim(data):
        pass
    (tmp_path / "file").touch()
    with pytest.raises(BadInputError, match="is no folder"), record_claim(tmp_path / "file"):
        pass


def test_the_folder_on_another_disk_is_claimed_too(tmp_path: Path) -> None:
    """Where a recording goes on when its own disk fails, nobody else records; it is not made where its disk is away."""
    data, spare, other = tmp_path / "data", tmp_path / "spare", tmp_path / "other"
    with folder_claims(data, spare, "svev serve", "--data"):
        assert not spare.exists()
    spare.mkdir()
    with folder_claims(data, spare, "svev serve", "--data"):
        with pytest.raises(BadInputError, match=rf"{spare}: another svev serve .*, or choose another --out"):
            record_claim(spare).__enter__()
        said = rf"{spare}: another svev serve .*, or choose another recorder.fallback_directory"
        with pytest.raises(BadInputError, match=said):
            folder_claims(other, spare, "svev record", "--out").__enter__()
        with record_claim(other):
            pass
    with folder_claims(spare, spare / ".." / "spare", "svev serve", "--data"):
        pass


def test_removing_the_lock_file_opens_the_directory_to_nobody(tmp_path: Path) -> None:
    with serve_claim(tmp_path):
        (tmp_path / LOCK).unlink()
        with pytest.raises(BadInputError, match="another svev uses it"), record_claim(tmp_path):
            pass
        (tmp_path / LOCK).write_text("1 \x1b[2J\n")
        with pytest.raises(BadInputError, match="another svev uses it"), record_claim(tmp_path):
            pass
    with record_claim(tmp_path):
        pass


def test_a_lock_file_that_was_replaced_while_it_was_locked_keeps_nobody_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On file systems that lock files only: who waits between opening and locking does not hold the next one's file."""
    flock = fcntl.flock
    locked: list[int] = []

    def replaced(descriptor: int, how: int) -> None:
        if stat.S_ISDIR(os.fstat(descriptor).st_mode):
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        if not locked:
            (tmp_path / LOCK).rename(tmp_path / "old")
        flock(descriptor, how)
        locked.append(os.fstat(descriptor).st_ino)

    monkeypatch.setattr(fcntl, "flock", replaced)
    with record_claim(tmp_path):
        assert locked == [(tmp_path / "old").stat().st_ino, (tmp_path / LOCK).stat().st_ino]
        with pytest.raises(BadInputError, match="another svev record"), serve_claim(tmp_path):
            pass
