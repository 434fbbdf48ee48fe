"""Campaigns for tests: their file, logs that hold nothing, and a survey."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from simrig.world.survey import survey
from tests.analysis.simulated import training

SURVEY: Final = "survey.json"


def campaign_file(folder: Path, *, logs: Sequence[str] = ("hill",), more: str = "") -> Path:
    """A campaign of one hill, with its survey beside it.

    Args:
        folder: for both.
        logs: places of the logs.
        more: further lines.
    """
    scenario = training()
    (folder / SURVEY).write_text(json.dumps(survey(scenario, (640, 480))), encoding="utf-8")
    path = folder / "season.toml"
    path.write_text(
        f'name = "Training"\nout = "season"\n[[hills]]\nname = "Hill"\nlogs = {json.dumps(list(logs))}\n'
        f'survey = "{SURVEY}"\n{more}\n',
        encoding="utf-8",
    )
    return path


def log_file(path: Path, content: bytes = b"") -> Path:
    """A file that is called as a log."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    return path
