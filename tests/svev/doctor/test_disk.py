import os
import resource
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rig.settings.model import OffloadSettings, RigSettings
from svev.doctor import disk
from svev.doctor.finding import Level
from tests.support.rigs import SIM

GOOD = disk.Trial(direct=True, write_bps=1e9, read_bps=1e9, same=True)


@pytest.fixture
def scratch(tmp_path: Path) -> Iterator[int]:
    fd = os.open(tmp_path / "scratch", os.O_RDWR | os.O_CREAT)
    yield fd
    os.close(fd)


def test_what_is_written_comes_back(scratch: int) -> None:
    trial = disk.try_disk(scratch, 16 << 20)
    assert trial.same
    assert trial.write_bps > 0
    assert trial.read_bps > 0
    assert os.fstat(scratch).st_size == 16 << 20


def test_a_directory_that_a_recording_would_make_is_examined_and_nothing_stays(tmp_path: Path) -> None:
    findings = list(disk.look_at_disk(SIM, tmp_path / "season" / "day"))
    assert f"{tmp_path / 'season' / 'day'} can be written" in [finding.what for finding in findings]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("inside", ["", "deeper"])
def test_a_path_through_a_file_fails(tmp_path: Path, inside: str) -> None:
    (tmp_path / "file").touch()
    (finding,) = disk.look_at_disk(SIM, tmp_path / "file" / inside)
    assert finding.level is Level.FAIL
    assert "cannot be written: Not a directory" in finding.what


def test_a_directory_that_refuses_fails() -> None:
    (finding,) = disk.look_at_disk(SIM, Path("/proc/self/task"))
    assert finding.level is Level.FAIL
    assert finding.remedy == "correct its permissions, or choose another recorder.directory or --out"


def test_a_disk_that_stops_taking_data_fails(tmp_path: Path) -> None:
    # The limit holds for a process and what it starts, so it takes a process of its own.
    program = (
        "from pathlib import Path\nfrom svev.doctor.disk import look_at_disk\n"
        "from tests.support.rigs import SIM\n"
        f"for finding in look_at_disk(SIM, Path({str(tmp_path)!r})): print(finding.level, finding.what)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, 1 << 20)),
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    assert f"FAIL {tmp_path} cannot be written" in done.stdout
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("free_gb", "level"), [(0.9, Level.FAIL), (1.0, Level.FAIL), (3.0, Level.WARN), (100.0, Level.PASS)]
)
def test_room_is_what_is_left_above_the_reserve(free_gb: float, level: Level) -> None:
    assert disk.look_at_room(SIM, Path("disk"), round(free_gb * 1e9)).level is level


def test_room_is_told_in_minutes_and_jumps() -> None:
    # 3 cameras x 640 x 480 x 30 Hz = 27.648 MB/s; 1 GB is the reserve
    finding = disk.look_at_room(SIM, Path("disk"), 1_000_000_000 + 27_648_000 * 600)
    assert finding.what == "17.6 GB free in disk: 10 min of recording, 60 jumps of 10 s"
    longer = SIM.model_copy(update={"recorder": SIM.recorder.model_copy(update={"jump_s": 25.0})})
    finding = disk.look_at_room(longer, Path("disk"), 1_000_000_000 + 27_648_000 * 600)
    assert finding.what == "17.6 GB free in disk: 10 min of recording, 24 jumps of 25 s"


@pytest.mark.parametrize(
    ("trial", "level", "word"),
    [
        (disk.Trial(True, 20e6, 1e9, True), Level.FAIL, "the disk writes 20"),
        (disk.Trial(True, 30e6, 1e9, True), Level.WARN, "the disk writes 30"),
        (disk.Trial(True, 1e9, 1e9, False), Level.FAIL, "does not give back what was written"),
        (disk.Trial(False, 1e9, 1e9, True), Level.WARN, "no direct I/O"),
    ],
)
def test_a_trial_is_judged_by_what_the_rig_needs(trial: disk.Trial, level: Level, word: str) -> None:
    findings = list(disk.judge_trial(SIM, Path("disk"), trial))
    (finding,) = (finding for finding in findings if finding.level is not Level.PASS)
    assert finding.level is level
    assert word in finding.what
    assert finding.remedy


def test_a_good_disk_passes() -> None:
    assert [finding.level for finding in disk.judge_trial(SIM, Path("disk"), GOOD)] == [Level.PASS]


def _with_fallback(folder: Path) -> RigSettings:
    return SIM.model_copy(update={"recorder": SIM.recorder.model_copy(update={"fallback_directory": folder})})


def _with_copies(folder: Path) -> RigSettings:
    return SIM.model_copy(update={"offload": OffloadSettings(to=folder)})


@pytest.mark.parametrize("asked", [_with_fallback, _with_copies])
@pytest.mark.parametrize(
    ("folder", "level", "word"),
    [
        (Path("/dev/shm/season"), Level.PASS, "GB free in"),  # noqa: S108 - a file system of its own
        (Path("second"), Level.WARN, "on the same disk"),
        (Path("/proc/self/task"), Level.FAIL, "cannot be written"),
    ],
)
def test_the_other_disks_are_examined(
    folder: Path, level: Level, word: str, asked: Callable[[Path], RigSettings], tmp_path: Path
) -> None:
    (finding,) = disk.look_at_other_disks(asked(tmp_path / folder), tmp_path)
    assert (finding.level, word in finding.what) == (level, True), finding
    assert list(tmp_path.iterdir()) == []
    assert list(disk.look_at_other_disks(SIM, tmp_path)) == []
