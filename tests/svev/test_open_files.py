"""A shell that allows too few open files: one line that says what to do, at once."""

import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest

from tests.capture.rigs import write_rig
from tests.service.serving import serving
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable

pytestmark = pytest.mark.long


def _svev(files: int, *arguments: str, taken: int = 0) -> "subprocess.CompletedProcess[str]":
    """A command that may have so many files open, some of which are taken already."""
    given = [os.open(os.devnull, os.O_RDONLY) for _ in range(taken)]
    try:
        return subprocess.run(
            [sys.executable, "-m", "svev", *arguments], capture_output=True, text=True, timeout=90, check=False,
            pass_fds=given, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (files, files)),
        )  # fmt: skip
    finally:
        for descriptor in given:
            os.close(descriptor)


@pytest.mark.parametrize("command", ["record", "serve", "demo", "info", "doctor", "ctl"])
@pytest.mark.parametrize(("files", "taken"), [(16, 0), (64, 45)])
def test_too_few_files_are_one_line(
    command: str, files: int, taken: int, tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    rig, out = str(write_rig(tmp_path, "sim", loopback)), str(tmp_path / "out")
    options = {
        "record": ["--rig", rig, "--seconds", "1", "--out", out],
        "serve": ["--rig", rig, "--data", out],
        "demo": ["--seconds", "1", "--out", out],
        "info": [rig],
        "doctor": ["--rig", rig],
        "ctl": ["status"],
    }
    done = _svev(files, command, *options[command], taken=taken)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("svev: only ")
    assert done.stderr.endswith(
        "more files may be opened here, and svev needs 48: run `ulimit -n 1024` and call again\n"
    )
    assert not Path(out).exists()
    if command == "record" and not taken:
        fault_table.tell("Processes", f"`ulimit -n {files}`", lost="all", said=done.stderr, code=done.returncode)


def test_the_fewest_files_are_enough_to_record(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    done = _svev(64, "record", "--rig", str(rig), "--seconds", "1", "--out", str(tmp_path / "out"))
    assert (done.returncode, done.stdout.splitlines()[0]) == (0, "30 pulses, 30 complete"), done.stderr


def test_the_fewest_files_are_enough_to_serve(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    with serving(tmp_path, rig, loopback, prefix=("prlimit", "--nofile=64:64")) as service:
        service.arm()
        recording = service.post("/api/recordings")["id"]
        service.await_pulses(30)
        assert service.post(f"/api/recordings/{recording}/stop")["state"] == "finished"


def test_what_runs_out_later_is_one_line_too(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, "sim", loopback)
    program = (
        "import os, sys; import svev.cli as cli; cli._LEAST_FILES = 0; "
        "taken = [os.open(os.devnull, os.O_RDONLY) for _ in range(48)]; sys.exit(cli.main())"
    )
    options = ["record", "--rig", str(rig), "--seconds", "1", "--out", str(tmp_path / "out")]
    done = subprocess.run(
        [sys.executable, "-c", program, *options], capture_output=True, text=True, timeout=90, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64)),
    )  # fmt: skip
    assert done.returncode == 6
    assert done.stderr == (
        "svev: the processes of the rig: cannot be started (Too many open files); see what this login may use: "
        "ulimit -a\n"
    )
