"""What the measuring of a log came to, in the folder of its result."""

import json
from datetime import datetime
from pathlib import Path
from typing import Final

from pydantic import Field, ValidationError

from recorder.log.beside import measured_path
from rig.api.fields import Model
from rig.api.jump import LastJump
from rig.api.measuring import AfterStep
from rig.api.statement import Statement
from rig.host.disk import replace_file
from rig.host.files import TEXT_MAX, opened_folder, read_whole

#: The file, beside those for people and programs.
NAME: Final = "measurement.json"


class Outcome(Model):
    """What the measuring of a log came to; in the folder beside the files of the analysis.

    Attributes:
        measured: when, UTC.
        version: of svev.
        jumps: main figures of the jumps of the result that lies in the folder.
        problem: why the last attempt failed; the result, if there is one, is of an attempt before.
        source: by which content of survey or poses the last attempt failed, as `service.measuring.retries` marks it;
            None if it failed for another reason, or did not.
        further: what was tried with the log afterwards, and why it failed.
        names: the corrections of the session that stand in the result's files.
    """

    measured: datetime
    version: str
    jumps: tuple[LastJump, ...] = ()
    problem: Statement | None = None
    source: str | None = None
    further: tuple[tuple[AfterStep, Statement | None], ...] = ()
    names: dict[str, str] = Field(default_factory=dict)


def read_outcome(folder: Path) -> Outcome | None:
    """What stands in the folder of a result; None if there is none, or it cannot be read."""
    try:
        with opened_folder(folder):
            return Outcome.model_validate(json.loads(read_whole(folder / NAME, TEXT_MAX, links=False)))
    except (OSError, ValueError, ValidationError):
        return None


def write_outcome(outcome: Outcome, folder: Path) -> None:
    """Write it into the folder of a result, as a whole.

    Raises:
        OSError: the disk refuses.
    """
    replace_file(folder / NAME, (outcome.model_dump_json() + "\n").encode(), links=False)


def outcome_path(log: Path) -> Path:
    """Where stands what the measuring of a log came to; the file is replaced as a whole."""
    return measured_path(log) / NAME
