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

#: In a process of its own, as a workplace would use it: the libraries keep threads and connections.
_STORE = """
import json, sys, fsspec
store = fsspec.filesystem("s3", endpoint_url=sys.argv[1])
if sys.argv[2] == "put":
    store.mkdir("hill")
    for path in sys.argv[3:]:
        store.put_file(path, "hill/day/" + path.rsplit("/", 1)[1])
else:
    store.get("hill/day/", sys.argv[3], recursive=True)
"""
_KEYS = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_DEFAULT_REGION": "us-east-1"}  # no secrets


@pytest.fixture
def server(loopback: Loopback) -> Iterator[str]:
    """The address of an S3 server."""
    port = loopback.free_port()
    command = [sys.executable, "-m", "moto.server", "-H", loopback.host, "-p", str(port)]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if "Running on" in line:
                break
        yield f"http://{loopback.host}:{port}"
        process.kill()


def store(server: str, *arguments: str) -> None:
    command = [sys.executable, "-c", _STORE, server, *arguments]
    subprocess.run(command, env=os.environ | _KEYS, timeout=60, check=True)


def season_run(campaign: Path) -> dict[str, Any]:
    command = [sys.executable, "-m", "svev", "season", "run", str(campaign), "--workers", "1", "--json"]
    done = subprocess.run(command, env=os.environ | _KEYS, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.long
@pytest.mark.timeout(500)
def test_logs_of_an_object_store_are_measured_there(tmp_path: Path, server: str) -> None:
    alone = measured_jump()
    damaged = tmp_path / "2026-11-22T10-00-00Z.mcap"
    damaged.write_bytes(b"no log")
    store(server, "put", str(alone.log.path), str(damaged))
    campaign = campaign_file(tmp_path, logs=["s3://hill/day"], more=f'[store]\nendpoint_url = "{server}"')
    found = season_run(campaign)
    assert (found["done"], found["failed"], found["jumps"]) == (1, 1, 1), found["problems"]
    assert list(found["problems"]) == ["s3://hill/day/2026-11-22T10-00-00Z.mcap"]
    again = season_run(campaign)
    assert again["problems"] == found["problems"]
    there = tmp_path / "there"
    store(server, "get", str(there))
    outcome = decoded((there / f"{FIRST_DAY}.season" / OUTCOME).read_bytes())
    assert outcome is not None
    assert outcome.state is LogState.DONE
    ours, theirs = contents(there / f"{FIRST_DAY}.season"), contents(alone.result)
    assert ours.keys() == theirs.keys()
    assert [name for name in ours if ours[name] != theirs[name]] == []
    assert f"s3://hill/day/{FIRST_DAY}.season/report.html" in (tmp_path / "season" / "season.html").read_text()
