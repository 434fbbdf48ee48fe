"""Jumps on the simulated hill and what `svev analyze` writes of them, measured once for all workers."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from bench.analysis.hill_logs import HillLog
from simrig.world.survey import survey
from tests.analysis.simulated import training
from tests.support.commands import run_svev
from tests.support.kept import kept, kept_hill_log

#: The jumper is in sight from hill pulse 23 to 60.
PULSES: Final = range(14, 70)
FIRST_DAY: Final = "2026-11-21T10-00-00Z"
_MEASURED_S: Final = 170
_ALL: Final = slice(None)


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredJump:
    """A log and its results; not to be changed.

    Attributes:
        log: it.
        result: the folder that `svev analyze` has written.
        summary: what it has said with --json.
    """

    log: HillLog
    result: Path
    summary: dict[str, Any]


def measured_jump(recording: str = FIRST_DAY, pulses: range = PULSES, cameras: slice = _ALL) -> MeasuredJump:
    """A jump of the training scenario, by hill pulses, in some of its cameras."""
    scenario = training()
    scenario = scenario.model_copy(update={"cameras": scenario.cameras[cameras]})
    log = kept_hill_log(scenario, pulses, recording)

    def measure(folder: Path) -> None:
        balls = folder / "survey.json"  # of all cameras, as a season has it
        balls.write_text(json.dumps(survey(training(), (640, 480))), encoding="utf-8")
        command = ("analyze", log.path, "--survey", balls, "--out", folder / "result", "--json")
        done = run_svev(*map(str, command), timeout_s=_MEASURED_S)
        assert done.returncode == 0, done.stderr
        (folder / "summary.json").write_text(done.stdout)

    folder = kept("measured-jump", measure, recording, pulses, cameras)
    return MeasuredJump(log, folder / "result", json.loads((folder / "summary.json").read_text()))
