"""Logs in an object store: a real S3 server on loopback (moto), read and written through fsspec."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from season.running.outcome import LogState, decoded
from season.running.stores import OUTCOME
from tests.analysis.measured import FIRST_DAY, measured_jump
from tests.season.files import campaign_file
from tests.season.test_run import contents
from tests.support.loopback import Loopback
from tests.support.object_store import KEYS, object_store, put, take


@pytest.fixture
def server(loopback: Loopback) -> Iterator[str]:
    """The address of an S3 server."""
    with object_store(loopback) as address:
        yield address


def season_run(campaign: Path) -> dict[str, Any]:
    command = [sys.executable, "-m", "svev", "season", "run", str(campaign), "--workers", "1", "--json"]
    done = subprocess.run(command, env=os.environ | KEYS, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.long
@pytest.mark.timeout(500)
def test_logs_of_an_object_store_are_measured_there(tmp_path: Path, server: str) -> None:
    alone = measured_jump()
    damaged = tmp_path / "2026-11-22T10-00-00Z.mcap"
    damaged.write_bytes(b"no log")
    put(server, "hill/day", str(alone.log.path), str(damaged))
    campaign = campaign_file(tmp_path, logs=["s3://hill/day"], more=f'[store]\nendpoint_url = "{server}"')
    found = season_run(campaign)
    assert (found["done"], found["failed"], found["jumps"]) == (1, 1, 1), found["problems"]
    assert list(found["problems"]) == ["s3://hill/day/2026-11-22T10-00-00Z.mcap"]
    again = season_run(campaign)
    assert again["problems"] == found["problems"]
    there = tmp_path / "there"
    take(server, "hill/day", str(there))
    outcome = decoded((there / f"{FIRST_DAY}.season" / OUTCOME).read_bytes())
    assert outcome is not None
    assert outcome.state is LogState.DONE
    ours, theirs = contents(there / f"{FIRST_DAY}.season"), contents(alone.result)
    assert ours.keys() == theirs.keys()
    assert [name for name in ours if ours[name] != theirs[name]] == []
    assert f"s3://hill/day/{FIRST_DAY}.season/report.html" in (tmp_path / "season" / "season.html").read_text()
