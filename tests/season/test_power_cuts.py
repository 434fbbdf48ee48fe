"""The power goes at any moment of a season's run: results, state and tables that are older than a second are there."""

import os
import random
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Final

import pytest

from rig.clocks import NS_PER_S
from tests.analysis.measured import FIRST_DAY, PULSES
from tests.analysis.simulated import training
from tests.season.files import campaign_file, log_file
from tests.support.kept import kept_hill_log
from tests.support.recorded_disk import RecordedDisk

_CUTS: Final = 200
_RUN_S: Final = 170.0


def _is_kept(name: str) -> bool:
    """Whether a file is a result, the state or a table, and not one in the making."""
    return not any(part.startswith(".") for part in Path(name).parts)


@pytest.mark.long
def test_results_and_state_of_a_season_outlive_a_power_cut(tmp_path: Path) -> None:
    notes = tmp_path / "notes"
    notes.mkdir()
    jump = kept_hill_log(training(), PULSES, FIRST_DAY)
    (tmp_path / "hill").mkdir()
    shutil.copy(jump.path, tmp_path / "hill" / "2026-11-21T10-00-00Z.mcap")
    disk = RecordedDisk(notes, tmp_path)
    campaign = campaign_file(tmp_path)
    command = [sys.executable, "-m", "svev", "season", "run", str(campaign)]
    for damaged in ("2026-11-21T11-00-00Z", "2026-11-21T12-00-00Z"):
        log_file(tmp_path / "hill" / f"{damaged}.mcap", b"no log at all")
        done = subprocess.run(
            command, env=os.environ | disk.environment, capture_output=True, text=True, timeout=_RUN_S, check=False
        )
        assert done.returncode == 0, done.stderr
        time.sleep(1.5)  # what was done is then older than a second
    history = disk.history()
    kept = {name: content for name, content in history.seen(history.calls[-1].end).items() if _is_kept(name)}
    assert kept == {name: (tmp_path / name).read_bytes() for name in kept}, "all that was done is recorded"
    assert {"jumper.json", "season.duckdb", "season.html"} <= {Path(name).name for name in kept}
    draw = random.Random(11)
    begin, last = history.calls[0].time_ns, history.calls[-1].time_ns
    found: list[str] = []
    for cut in range(_CUTS):
        moment = draw.choice(history.calls).time_ns if cut % 2 else draw.randrange(begin, last + NS_PER_S)
        end = history.at(moment)
        left = history.after_cut(end, draw)
        for name, versions in history.versions(history.at(moment - NS_PER_S), end, _is_kept).items():
            if left.get(name) not in versions:
                found.append(f"{(moment - begin) / NS_PER_S:.3f} s after the beginning: {name}")
    assert not found, f"{len(found)} files in {_CUTS} cuts: {found[:20]}"
