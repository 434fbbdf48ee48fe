"""Room on the disk, as `df` reckons it, and files renewed whole."""

import os
import subprocess
from pathlib import Path

import pytest

from rig.host.disk import free_bytes, replace_file


def test_room_is_what_df_says_is_available(tmp_path: Path) -> None:
    done = subprocess.run(["/bin/df", "-B1", "--output=avail", tmp_path], capture_output=True, text=True, check=True)
    available = int(done.stdout.split()[-1])
    with (tmp_path / "file").open("wb") as file:
        for place in (tmp_path, file.fileno()):
            assert free_bytes(place) == pytest.approx(available, rel=0.05)


def test_a_directory_that_is_not_there_has_no_room_to_tell(tmp_path: Path) -> None:
    assert free_bytes(tmp_path / "unplugged") is None


def test_a_renewed_file_keeps_its_rights(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("old")
    group = max(os.getgroups(), default=os.getgid())
    owner = 12345 if os.geteuid() == 0 else os.geteuid()
    os.chown(path, owner, group)
    path.chmod(0o664)
    replace_file(path, b"new", links=True)
    status = path.stat()
    assert (path.read_bytes(), status.st_uid, status.st_gid, status.st_mode & 0o777) == (b"new", owner, group, 0o664)
    assert list(tmp_path.iterdir()) == [path]
