"""Hostile logs: no traceback, bounded memory, one line for each error."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.recorder.hostile.corpus import corpus

pytestmark = pytest.mark.long

REPOSITORY = Path(__file__).parents[3]
#: A log takes the memory of its longest chunk (256 MB at most), and this program itself.
PEAK_MB = 600
SHARDS = 4
#: Documented for each command; asking the catalogue for what is not there gives 1.
CODES = {
    "verify": {0, 2, 3, 7},
    "verify --json": {0, 2, 3, 7},
    "replay": {0, 2, 3},
    "recover": {0, 2, 3},
    "catalogue": {0, 1, 2, 3},
}


def test_there_are_enough_of_them_and_they_are_always_the_same(tmp_path: Path) -> None:
    made = corpus()
    assert len(made) >= 75
    some = [name for name in made if not name.startswith(("session", "shaken", "sparse"))][::7]
    for name in some:
        made[name](tmp_path / "one.mcap")
        corpus_again = (tmp_path / "one.mcap").read_bytes()
        made[name](tmp_path / "one.mcap")
        assert (tmp_path / "one.mcap").read_bytes() == corpus_again


@pytest.mark.parametrize("shard", range(SHARDS))
def test_no_hostile_log_does_harm(tmp_path: Path, shard: int) -> None:
    made = corpus()
    for name in sorted(made)[shard::SHARDS]:
        made[name](tmp_path / f"{name}.mcap")
    # A child of its own, whose memory is limited and measured.
    ran = subprocess.run(
        [sys.executable, "-m", "tests.recorder.hostile.run_commands", str(tmp_path)],
        capture_output=True, text=True, cwd=REPOSITORY, timeout=600, check=False,
    )  # fmt: skip
    assert (ran.returncode, ran.stderr) == (0, "")
    results = [json.loads(line) for line in ran.stdout.splitlines()]
    assert {result["log"] for result in results} == set(sorted(made)[shard::SHARDS])
    for result in results:
        where = (result["log"], result["command"])
        assert not result["traceback"], (where, result["traceback"])
        assert result["code"] in CODES.get(result["command"], {0, 2, 3}), where
        assert result["peak_mb"] < PEAK_MB, where
        _check_complaints(where, result)


def _check_complaints(where: tuple[str, str], result: dict[str, str | int]) -> None:
    """An error is one line, a result is said without one; no control character comes from the log."""
    complaints = str(result["complaints"])
    lines = complaints.splitlines()
    if lines and where[1] == "replay" and lines[0].startswith("publishing at"):
        lines = lines[1:]
    assert len(lines) == (1 if result["code"] else 0), (where, complaints)
    assert all(line.isprintable() and len(line) < 1000 for line in lines), (where, complaints)
