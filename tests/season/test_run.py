"""A campaign measured by `svev season run`: what goes wrong, what is killed, and that nothing is done twice."""

import json
import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from rig.errors import StorageError
from season.campaign import read_campaign
from season.running.outcome import LogState, decoded
from season.running.run import alone
from season.running.stores import OUTCOME
from tests.analysis.measured import measured_jump
from tests.season.files import campaign_file, log_file
from tests.support.waiting import wait_until

#: Files of a result that `svev analyze` does not write.
OURS = {OUTCOME, "season-jumps.csv", "season-pulses.csv", "season-cameras.csv"}


def season_run(campaign: Path, *more: str, timeout_s: float = 170) -> dict[str, Any]:
    """Run a campaign to its end."""
    command = [sys.executable, "-m", "svev", "season", "run", str(campaign), "--json", *more]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def started(campaign: Path) -> "subprocess.Popen[bytes]":
    """A campaign that runs, as the leader of a group of its own."""
    command = [sys.executable, "-m", "svev", "season", "run", str(campaign)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)


def kill_all(group: int) -> None:
    """Kill all processes of a group at once, but for Python's own that removes named semaphores after them."""
    for entry in Path("/proc").iterdir():
        with suppress(OSError, ValueError):
            if os.getpgid(int(entry.name)) == group and b"resource_tracker" not in (entry / "cmdline").read_bytes():
                os.kill(int(entry.name), signal.SIGKILL)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.name not in OURS}


def begun(folder: Path) -> list[Path]:
    """Results that are being written."""
    return [path for path in folder.glob(".*.season.*") if path.is_dir()]


def test_a_link_of_the_name_of_the_lock_is_not_followed(tmp_path: Path) -> None:
    target = tmp_path / "target"
    target.write_text("somebody's")
    campaign = read_campaign(campaign_file(tmp_path))
    campaign.out.mkdir(parents=True)
    (campaign.out / ".lock").symlink_to(target)
    with pytest.raises(StorageError, match="cannot be written"), alone(campaign):
        pass
    assert target.read_text() == "somebody's"


@pytest.mark.long
def test_a_log_that_cannot_be_measured_is_named_and_passed_over(tmp_path: Path) -> None:
    """It is not tried again before it changes."""
    damaged = log_file(tmp_path / "hill" / "damaged.mcap", b"no log at all")
    campaign = campaign_file(tmp_path)
    first = season_run(campaign, "--workers", "1")
    assert (first["failed"], first["done"]) == (1, 0)
    assert str(damaged) in first["problems"]
    outcome = decoded((damaged.with_suffix(".season") / OUTCOME).read_bytes())
    assert outcome is not None
    assert outcome.state is LogState.FAILED
    assert outcome.problem == first["problems"][str(damaged)]
    state = json.loads((tmp_path / "season" / "state.json").read_text())
    assert state["counts"] == {"waiting": 0, "running": 0, "done": 0, "failed": 1}
    assert state["logs"][str(damaged)]["duration_s"] > 0
    before = (damaged.with_suffix(".season") / OUTCOME).read_bytes()
    assert season_run(campaign)["problems"] == first["problems"]
    assert (damaged.with_suffix(".season") / OUTCOME).read_bytes() == before
    damaged.write_bytes(b"another content")
    season_run(campaign, "--workers", "1")
    assert (damaged.with_suffix(".season") / OUTCOME).read_bytes() != before


@pytest.mark.long
@pytest.mark.timeout(600)
def test_what_is_killed_is_resumed_and_equals_what_svev_analyze_writes(tmp_path: Path) -> None:
    hill = tmp_path / "hill"
    hill.mkdir()
    alone = [measured_jump(), measured_jump("2026-11-22T10-00-00Z", range(18, 66))]
    logs = [Path(shutil.copy(jump.log.path, hill)) for jump in alone]
    campaign = campaign_file(tmp_path)
    with started(campaign) as process:
        wait_until(lambda: len(begun(hill)) == 2, timeout_s=120, what="two logs are being measured")
        kill_all(process.pid)
    assert begun(hill)
    found = season_run(campaign, timeout_s=300)
    assert (found["done"], found["failed"], found["jumps"]) == (2, 0, 2), found["problems"]
    assert not begun(hill)
    before = [path.stat().st_mtime_ns for log in logs for path in sorted(log.with_suffix(".season").iterdir())]
    assert season_run(campaign)["done"] == 2
    assert before == [path.stat().st_mtime_ns for log in logs for path in sorted(log.with_suffix(".season").iterdir())]
    for log, jump in zip(logs, alone, strict=True):
        ours, theirs = contents(log.with_suffix(".season")), contents(jump.result)
        assert ours.keys() == theirs.keys()
        assert [name for name in ours if ours[name] != theirs[name]] == []
