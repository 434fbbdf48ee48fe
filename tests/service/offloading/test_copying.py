"""Copies of logs on another disk: gone on with after a break, read back, and never another log's."""

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.background.child import run_child
from rig.background.messages import End, Failed, Progress
from rig.errors import StorageError
from rig.transport.process_table import Child, ProcessSpec
from service.offloading import verified_copy
from service.offloading.orders import Copy
from service.offloading.verified_copy import copy_file
from tests.support.other_disk import may_mount
from tests.support.waiting import wait_until

DATA = np.random.default_rng(3).bytes(9_000_000)


def _copy(*paths: Path, to: Path, tell: Callable[[Progress], None] = lambda _: None) -> End | None:
    return run_child(
        "service.offloading.copying", Copy(paths=paths, to=to), Progress | End,
        busy=lambda: False, wanted=lambda: True, tell=tell, yielding=False,
    )  # fmt: skip


@pytest.fixture
def places(tmp_path: Path) -> tuple[Path, Path]:
    """A log, and the folder on the other disk."""
    (tmp_path / "here").mkdir()
    (tmp_path / "there").mkdir()
    log = tmp_path / "here" / "jump.mcap"
    log.write_bytes(DATA)
    return log, tmp_path / "there"


def test_a_copied_log_has_its_checksum_beside_it(places: tuple[Path, Path]) -> None:
    log, there = places
    results = log.with_suffix(".measured")
    results.mkdir()
    (results / "report.html").write_text("one")
    assert _copy(log, results, to=there) == End()
    assert sorted(path.name for path in there.iterdir()) == ["jump.mcap", "jump.mcap.sha256", "jump.measured"]
    checked = ["/usr/bin/sha256sum", "--check", "--quiet", "jump.mcap.sha256"]
    subprocess.run(checked, cwd=there, check=True)
    (results / "report.html").write_text("two")
    copied = (there / "jump.mcap").stat()
    assert _copy(log, results, to=there) == End()
    assert (there / "jump.measured" / "report.html").read_text() == "two"
    assert (there / "jump.mcap").stat() == copied


@pytest.mark.parametrize("length", [0, 5, 1 << 22, 5_000_000, len(DATA), len(DATA) + 3])
@pytest.mark.parametrize("end", [b"", b"?"], ids=["right", "wrong"])
def test_a_copy_that_broke_off_is_gone_on_with(places: tuple[Path, Path], length: int, end: bytes) -> None:
    log, there = places
    part = there / ".jump.mcap.part"
    part.write_bytes((DATA + b"abc")[:length] + end)
    before = part.stat().st_ino
    counted: list[int] = []
    assert copy_file(log, part, counted.append) == hashlib.sha256(DATA).hexdigest()
    assert part.read_bytes() == DATA
    assert part.stat().st_ino == before
    assert sum(counted) == 2 * len(DATA)


def test_what_is_read_back_otherwise_is_no_copy(places: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    log, there = places
    sync = verified_copy._sync

    def sync_to_a_bad_disk(writer: Any) -> None:
        sync(writer)
        os.pwrite(writer.fileno(), b"\0\0\0\0", 4_100_000)

    monkeypatch.setattr(verified_copy, "_sync", sync_to_a_bad_disk)
    with pytest.raises(StorageError, match=r"what was read back of jump\.mcap is not what was written"):
        copy_file(log, there / ".jump.mcap.part", lambda _: None)
    assert not list(there.iterdir())


def test_a_copy_of_an_earlier_version_is_confirmed_and_another_log_refused(places: tuple[Path, Path]) -> None:
    log, there = places
    (there / "jump.mcap").write_bytes(DATA)
    assert _copy(log, to=there) == End()
    assert (there / "jump.mcap.sha256").read_text() == f"{hashlib.sha256(DATA).hexdigest()}  jump.mcap\n"
    (there / "jump.mcap.sha256").unlink()
    (there / "jump.mcap").write_bytes(DATA[:-1] + b"?")
    end = _copy(log, to=there)
    assert isinstance(end, Failed)
    assert "is another log of this name" in end.said.text
    assert not (there / "jump.mcap.sha256").exists()


@pytest.mark.skipif(not may_mount(), reason="no mount namespace of our own is allowed here: no disk can be read-only")
def test_a_folder_that_cannot_be_written_is_said_to_be(places: tuple[Path, Path]) -> None:
    log, there = places
    program = (
        "import sys; from pathlib import Path; from tests.service.offloading.test_copying import _copy\n"
        "print(_copy(Path(sys.argv[1]), to=Path(sys.argv[2])).said.text)"
    )
    script = f'mount -t tmpfs -o ro none "{there}" && exec "$0" "$@"'
    command = ["unshare", "--mount", "sh", "-c", script, sys.executable, "-c", program, str(log), str(there)]
    said = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True).stdout
    assert said.startswith(f"{there}: nothing can be written there; mount its disk writable")


def test_a_killed_copy_leaves_no_log_and_goes_on(places: tuple[Path, Path]) -> None:
    log, there = places
    large = np.random.default_rng(4).bytes(40_000_000)
    log.write_bytes(large)
    part = there / ".jump.mcap.part"
    program = Child(ProcessSpec("copying", "service.offloading.copying", Copy(paths=(log,), to=there)))
    wait_until(part.exists, "it is begun")
    program.kill()
    assert not (there / "jump.mcap").exists()
    assert _copy(log, to=there) == End()
    assert (there / "jump.mcap").read_bytes() == large
