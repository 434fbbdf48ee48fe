"""Which jumps of the folder a jump is compared with."""

import json
from pathlib import Path

import pytest

from recorder.log.measured_path import measured_path
from recorder.log.session_changes import write_session_changes
from service.measuring.earlier import earlier_jumps


def _measured(folder: Path, recording: str, athlete: str, speed: float) -> Path:
    log = folder / f"{recording}.mcap"
    log.touch()
    measured_path(log).mkdir()
    jump = {
        "time": "2026-02-14T10:15:30+00:00",
        "ok": True,
        "figures": {"takeoff_speed": {"value": speed, "sigma": 0.01}, "v_angle": None},
    }
    content = {"format": "svev-kinogram/1", "recording": recording, "athlete": athlete, "jumps": [jump]}
    (measured_path(log) / "kinogram.json").write_text(json.dumps(content))
    return log


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four measured jumps, and a log that nobody has measured."""
    for order, athlete in enumerate(("Anna Berg", "anna  berg ", "Ola", ""), 1):
        _measured(tmp_path, f"jump-{order}", athlete, 25.0 + order)
    (tmp_path / "fresh.mcap").touch()
    return tmp_path


def _speeds(folder: Path, athlete: str = "Anna Berg", log: str = "fresh") -> list[float]:
    return [jump.figures["takeoff_speed"].value for jump in earlier_jumps(folder / f"{log}.mcap", athlete)]


def test_only_the_athletes_other_jumps(folder: Path) -> None:
    assert _speeds(folder) == [26.0, 27.0]
    assert _speeds(folder, log="jump-1") == [27.0]
    assert _speeds(folder, "") == []  # jumps without a name are of different people
    assert _speeds(folder, "Kari") == []
    assert earlier_jumps(folder / "fresh.mcap", "Anna Berg")[0].figures.keys() == {"takeoff_speed"}


def test_a_corrected_name_counts(folder: Path) -> None:
    write_session_changes(folder / "jump-3.mcap", {"athlete": "Anna Berg"})
    write_session_changes(folder / "jump-1.mcap", {"athlete": "Kari"})
    assert _speeds(folder) == [27.0, 28.0]


def test_a_result_without_its_log_and_broken_files_are_left_out(folder: Path) -> None:
    (folder / "jump-1.mcap").unlink()
    (measured_path(folder / "jump-2.mcap") / "kinogram.json").write_text("{")
    assert _speeds(folder) == []
