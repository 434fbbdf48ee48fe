"""What the processes of a rig of real cameras load at their start: time until the rig is armed."""

import subprocess
import sys

import pytest


@pytest.mark.parametrize(
    ("program", "needless"),
    [
        ("service.processes.programs.grabber", ("simrig", "cv2", "recorder", "capture.iidc", "gi")),
        ("service.processes.programs.recorder", ("simrig", "cv2", "recorder.reading", "capture")),
        ("svev.commands.rig.record", ("simrig", "cv2", "scipy", "fastapi", "capture.iidc", "season", "dask", "duckdb")),
        ("svev.commands.rig.serve", ("simrig", "scipy", "season", "dask", "duckdb")),
    ],
)
def test_nothing_is_loaded_that_real_cameras_do_not_need(program: str, needless: tuple[str, ...]) -> None:
    loaded = subprocess.run(
        [sys.executable, "-c", f"import sys, {program}; print(*sys.modules)"],
        capture_output=True, text=True, timeout=60, check=True,
    ).stdout.split()  # fmt: skip
    assert not [name for name in loaded if name.startswith(tuple(f"{each}." for each in needless)) or name in needless]
