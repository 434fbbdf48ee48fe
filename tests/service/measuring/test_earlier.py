"""Which jumps of the folder a jump is compared with: those that the athlete's page has."""

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest

from recorder.catalogue.folder import Catalogue
from recorder.log.beside import measured_path
from recorder.log.session_changes import write_session_changes
from rig.api.jump import LastJump
from service.measuring.keeping import keep_result
from service.measuring.program import _earlier
from service.recordings.measured_jumps import LogJudge, MeasuredJumps
from tests.recorder.logs import ALL_OK, write_log

TIME = datetime(2026, 2, 14, 10, 15, 30, tzinfo=UTC)


def _measured(folder: Path, recording: str, athlete: str, speed: float) -> Path:
    log = folder / f"{recording}.mcap"
    write_log(log, (ALL_OK,))
    write_session_changes(log, {"athlete": athlete})
    made = folder / "made"
    made.mkdir()
    jump = {
        "time": TIME.isoformat(),
        "ok": True,
        "figures": {"takeoff_speed": {"value": speed, "sigma": 0.01}, "v_angle": None},
    }
    content = {"format": "svev-kinogram/1", "recording": recording, "athlete": athlete, "jumps": [jump]}
    (made / "kinogram.json").write_text(json.dumps(content))
    keep_result(made, log, (LastJump(recording=recording, jump=1, time=TIME, ok=True, verdict="measured well"),))
    return log


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four measured jumps, and a log of the first athlete that nobody has measured."""
    for order, athlete in enumerate(("Anna Berg", "anna  berg ", "Ola", ""), 1):
        _measured(tmp_path, f"jump-{order}", athlete, 25.0 + order)
    write_log(tmp_path / "fresh.mcap", (ALL_OK,))
    write_session_changes(tmp_path / "fresh.mcap", {"athlete": "ANNA BERG"})
    return tmp_path


def _speeds(folder: Path, log: str = "fresh") -> list[float]:
    files = MeasuredJumps(Catalogue(folder, LogJudge())).others_of_athlete(log)
    return sorted(jump.figures["takeoff_speed"].value for jump in _earlier(files))


def test_only_the_athletes_other_jumps(folder: Path) -> None:
    assert _speeds(folder) == [26.0, 27.0]
    assert _speeds(folder, "jump-1") == [27.0]
    assert _speeds(folder, "jump-3") == []
    assert _speeds(folder, "jump-4") == [], "jumps without a name are of different people"
    assert _speeds(folder, "gone") == []


def test_a_corrected_name_counts(folder: Path) -> None:
    write_session_changes(folder / "jump-3.mcap", {"athlete": "Anna Berg"})
    write_session_changes(folder / "jump-1.mcap", {"athlete": "Kari"})
    assert _speeds(folder) == [27.0, 28.0]


def test_what_is_in_the_trash_and_broken_files_are_left_out(folder: Path) -> None:
    Catalogue(folder).delete("jump-1")
    assert _speeds(folder) == [27.0]
    (measured_path(folder / "jump-2.mcap") / "kinogram.json").write_text("{")
    assert _speeds(folder) == []
