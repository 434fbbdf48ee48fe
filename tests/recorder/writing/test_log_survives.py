"""What is left of a log when the process is killed or the disk is full: everything up to that moment."""

import os
import shutil
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO

import numpy as np
import pytest
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader

from recorder.checking.verify import verify
from recorder.reading.triplets import triplets
from tests.recorder.logs import make_image, make_tag
from tests.recorder.writing.writing_process import SHAPE

REPOSITORY = Path(__file__).parents[3]
WRITER = [sys.executable, "-m", "tests.recorder.writing.writing_process"]


def _check_contents(path: Path) -> int:
    """Every pulse that is there is right, and there is no gap; how many there are."""
    count = 0
    for count, (tag, image) in enumerate(triplets(path), 1):
        assert tag == make_tag(count, shape=SHAPE)
        assert np.array_equal(image, make_image(tag))
    return count


def test_a_killed_writer_loses_nothing_that_left_its_queue(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with subprocess.Popen([*WRITER, str(path)], stdout=subprocess.PIPE, text=True, cwd=REPOSITORY) as process:
        assert process.stdout is not None
        safe = 0
        for line in process.stdout:
            safe = int(line)
            if safe == 40:
                break
        process.send_signal(signal.SIGKILL)
    assert _check_contents(path) >= safe == 40
    report = verify(path)
    assert not report.closed
    assert report.ledger.complete == report.ledger.pulses >= safe
    assert not report.ledger.missing
    assert all("unfinished record" in finding or "was not closed" in finding for finding in report.findings)


def test_the_mcap_package_streams_what_a_killed_writer_left(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with subprocess.Popen([*WRITER, str(path)], stdout=subprocess.PIPE, text=True, cwd=REPOSITORY) as process:
        assert process.stdout is not None
        while int(process.stdout.readline()) < 10:
            pass
        process.send_signal(signal.SIGKILL)
    seen: list[int] = []
    with path.open("rb") as file, pytest.raises((McapError, struct.error, ValueError)):
        seen.extend(_streamed_pulses(file))
    assert seen == list(range(1, len(seen) + 1))
    assert len(seen) >= 10


def _streamed_pulses(file: IO[bytes]) -> Iterator[int]:
    messages = NonSeekingReader(file, validate_crcs=True).iter_messages(topics=["/triplet"], log_time_order=False)
    yield from (message.sequence for _, _, message in messages)


def _check_full(path: Path, output: str, remedy: str, *, closed: bool) -> None:
    """The writer said what to do; what left its queue is there, and the log is closed if there was room for that."""
    lines = output.splitlines()
    (error,) = (line for line in lines if line.startswith("error"))
    assert remedy in error
    assert "log.mcap" in error
    assert lines[-1].startswith("close ")
    pulses = _check_contents(path)
    assert pulses >= int(lines[-3])
    report = verify(path)
    assert report.closed == closed, report.findings
    assert report.ledger.complete == report.ledger.pulses == pulses
    if closed:
        assert report.verdict == "clean", report.findings
        with path.open("rb") as file:
            assert sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages(topics=["/triplet"])) == pulses
    else:
        assert len(report.findings) == 1


def _write_up_to(path: Path, room: int) -> str:
    """Write a log that may grow to so many bytes; what the writer said."""
    done = subprocess.run(
        [*WRITER, str(path), str(room)], capture_output=True, text=True, timeout=60, cwd=REPOSITORY, check=True
    )
    return done.stdout


def test_at_the_largest_file_size_everything_so_far_is_readable(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    _check_full(path, _write_up_to(path, 3_450_000), "ulimit -f", closed=True)
    # A hundred bytes less than that log took, and the same pulses fit, but not the end of the log.
    room = path.stat().st_size - 100
    path.unlink()
    _check_full(path, _write_up_to(path, room), "ulimit -f", closed=False)


def test_on_a_full_disk_everything_so_far_is_readable(tmp_path: Path) -> None:
    own_mounts = ["unshare", "--mount"] if os.geteuid() == 0 else ["unshare", "--mount", "--map-root-user"]
    if (
        shutil.which("unshare") is None
        or subprocess.run([*own_mounts, "true"], capture_output=True, check=False).returncode
    ):
        pytest.skip("no mount namespace of our own is allowed here: a small disk cannot be made")
    small, kept = tmp_path / "small", tmp_path / "log.mcap"
    small.mkdir()
    # The pulse that no longer fits leaves half of its size: enough for the end of the log.
    script = 'mount -t tmpfs -o size=3200k none "$1" && "$2" -m "$4" "$1/log.mcap" && cp "$1/log.mcap" "$3"'
    done = subprocess.run(
        [*own_mounts, "sh", "-c", script, "sh", str(small), sys.executable, str(kept), WRITER[2]],
        capture_output=True, text=True, timeout=60, cwd=REPOSITORY, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    _check_full(kept, done.stdout, "the disk is full: make room", closed=True)
