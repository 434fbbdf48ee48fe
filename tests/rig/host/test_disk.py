"""Room on the disk, as `df` reckons it."""

import subprocess
from pathlib import Path

import pytest

from rig.host.disk import free_bytes


def test_room_is_what_df_says_is_available(tmp_path: Path) -> None:
    done = subprocess.run(["/bin/df", "-B1", "--output=avail", tmp_path], capture_output=True, text=True, check=True)
    available = int(done.stdout.split()[-1])
    with (tmp_path / "file").open("wb") as file:
        for place in (tmp_path, file.fileno()):
            assert free_bytes(place) == pytest.approx(available, rel=0.05)


def test_a_directory_that_is_not_there_has_no_room_to_tell(tmp_path: Path) -> None:
    assert free_bytes(tmp_path / "unplugged") is None
