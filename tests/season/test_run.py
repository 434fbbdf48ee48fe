"""A campaign measured by `svev season run`: what goes wrong, what is killed, and that nothing is done twice."""

import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from rig.errors import StorageError
from rig.host.object_store import StoreSilentError
from season.campaign import read_campaign
from season.running.logs import find_logs
from season.running.outcome import LogState, decoded
from season.running.run import _SILENCES, _Hearer, alone
from season.running.state import SeasonState
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


def members(group: int) -> list[int]:
    """The processes of a group, but for Python's own that removes named semaphores after them."""
    found = []
    for entry in Path("/proc").iterdir():
        with suppress(OSError, ValueError):
            if os.getpgid(int(entry.name)) == group and b"resource_tracker" not in (entry / "cmdline").read_bytes():
                found.append(int(entry.name))
    return found


def kill(pid: int) -> None:
    """Kill a process, if it still runs."""
    with suppress(ProcessLookupError):
        os.kill(pid, signal.SIGKILL)


def kill_all(group: int) -> None:
    """Kill all processes of a group at once."""
    for pid in members(group):
        kill(pid)


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


def test_a_store_that_falls_silent_ends_the_run(tmp_path: Path) -> None:
    """Else every log would wait for it."""
    log = log_file(tmp_path / "hill" / "a.mcap")
    logs = {each.url: each for each in find_logs(read_campaign(campaign_file(tmp_path)))}
    hearer = _Hearer(logs, {}, SeasonState(tmp_path / "state.json", "Training", logs.values()), lambda _: None)
    silence = StoreSilentError("the object store does not answer")
    for _ in range(_SILENCES - 1):
        hearer.failed(str(log), silence)
    hearer.failed(str(log), OSError("damaged"))  # it answers
    for _ in range(_SILENCES - 1):
        hearer.failed(str(log), silence)
    with pytest.raises(StorageError, match=r"does not answer; what is measured stays: run the season again when"):
        hearer.failed(str(log), silence)


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


def settled(hill: Path) -> dict[str, tuple[int, int]]:
    """The logs of which something has come, and what tells when that was written."""
    stats = {path.parent.name: path.stat() for path in hill.glob(f"[!.]*.season/{OUTCOME}")}
    return {name: (stat.st_ino, stat.st_mtime_ns) for name, stat in stats.items()}


def told(hill: Path) -> dict[str, tuple[str, LogState, str | None]]:
    """What came of the logs, without when and where."""
    found = {}
    for path in hill.glob(f"*.season/{OUTCOME}"):
        outcome = decoded(path.read_bytes())
        assert outcome is not None
        found[path.parent.name] = (outcome.key, outcome.state, outcome.problem)
    return found


def no_logs(hill: Path, numbers: range) -> None:
    """Logs that cannot be measured, which is found soon."""
    for number in numbers:
        log_file(
            hill / f"2026-12-01T{number // 3600:02}-{number // 60 % 60:02}-{number % 60:02}Z.mcap",
            b"no log %d" % number,
        )


@pytest.mark.long
def test_a_run_that_is_interrupted_says_what_stays(tmp_path: Path) -> None:
    hill = tmp_path / "hill"
    no_logs(hill, range(300))
    command = [sys.executable, "-m", "svev", "season", "run", str(campaign_file(tmp_path)), "--json"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        wait_until(lambda: len(settled(hill)) > 5, "something has come of some logs", 120)
        process.terminate()
        said = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert re.search(r"what came of \d+ of 300 logs lies beside them and stays; run the same command again", said)


@pytest.mark.long
@pytest.mark.timeout(900)
def test_what_is_killed_is_resumed_and_equals_what_svev_analyze_writes(tmp_path: Path) -> None:
    """500 logs, five of them real: a worker is killed, then everything; the rest by one worker, one after the other."""
    hill, other = tmp_path / "hill", tmp_path / "serial" / "hill"
    no_logs(hill, range(495))
    no_logs(other, range(495))
    alone = [
        measured_jump(),
        measured_jump("2026-11-22T10-00-00Z", range(18, 66)),
        measured_jump("2026-12-02T10-00-00Z", range(90)),  # the last three are those that a killed campaign leaves
        measured_jump("2026-12-03T10-00-00Z", range(20, 52)),
        measured_jump("2026-12-04T10-00-00Z", cameras=slice(2)),
    ]
    logs = [Path(shutil.copy(jump.log.path, hill)) for jump in alone]
    campaign = campaign_file(tmp_path)
    with started(campaign) as process:
        wait_until(lambda: len(begun(hill)) == 2, timeout_s=120, what="two logs are being measured")
        kill(next(pid for pid in members(process.pid) if pid != process.pid))
        before = settled(hill)
        wait_until(lambda: len(settled(hill)) > len(before) + 20, timeout_s=120, what="it goes on")
        kill_all(process.pid)
    before = settled(hill)
    assert before
    assert begun(hill)
    found = season_run(campaign, timeout_s=400)
    assert (found["done"], found["failed"], found["jumps"]) == (5, 495, 5)
    assert not begun(hill)
    after = settled(hill)
    assert {name: after[name] for name in before} == before, "what was done is not done again"
    assert season_run(campaign)["done"] == 5
    assert settled(hill) == after
    for log, jump in zip(logs, alone, strict=True):
        ours, theirs = contents(log.with_suffix(".season")), contents(jump.result)
        assert ours.keys() == theirs.keys()
        assert [name for name in ours if ours[name] != theirs[name]] == []
    season_run(campaign_file(other.parent), "--workers", "1", timeout_s=300)
    serial = told(other)
    assert len(serial) == 495
    assert {name: ours for name, ours in told(hill).items() if name in serial} == serial


def await_more(hill: Path, count: int, process: "subprocess.Popen[bytes]") -> None:
    """Wait until something has come of more than so many logs, or the campaign has ended."""
    wait_until(lambda: len(settled(hill)) > count or process.poll() is not None, "it goes on", 120)


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_a_hundred_kills_of_any_process_repeat_only_what_was_in_hand(tmp_path: Path) -> None:
    """Never what was done when the command was given; within a run, what a dying worker may not have told of yet."""
    hill, draw, written = tmp_path / "hill", random.Random(100), 500
    no_logs(hill, range(written))
    campaign, known, repeated = campaign_file(tmp_path), settled(hill), 0
    process, done = started(campaign), known
    for _ in range(100):
        await_more(hill, len(known), process)
        kill(draw.choice(members(process.pid) or [process.pid]))
        now = settled(hill)
        repeated += sum(now.get(name) != at for name, at in known.items())
        assert {name: now.get(name) for name in done} == done, "what was done is not done again"
        known = now
        if process.poll() is not None:
            kill_all(process.pid)  # workers of a dead scheduler
            known = done = settled(hill)
            if written - len(done) < 100:
                no_logs(hill, range(written, written + 300))
                written += 300
            process = started(campaign)
    kill_all(process.pid)
    process.wait()
    done = settled(hill)
    assert season_run(campaign, timeout_s=300)["failed"] == written
    assert {name: at for name, at in settled(hill).items() if name in done} == done
    assert repeated <= 4 * 100, "no more than two for each thread and kill"
    assert not begun(hill)
