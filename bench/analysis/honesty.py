"""Whether the sigmas of measured jumps hold: rendered jumps, each measured with many drawn surveys of the balls."""

import json
import tempfile
import time
from collections.abc import Iterator
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Final

from analysis.procedure.analyze import look
from analysis.scene.static_image import static_images
from bench.analysis.hill_logs import HillLog, write_hill_log
from bench.analysis.judge import Judged
from bench.analysis.jumps import PULSES, SCENARIOS, measured, scenario_of
from rig.each import Each
from simrig.world.scenario import Scenario
from simrig.world.survey import survey

#: Surveys that are drawn for each rendered jump. The jump's own noise is common to them, so that more jumps say more.
SURVEYS_PER_JUMP: Final = 20
_SEED: Final = 5000


def run_honesty(seconds: float, each: Each = map, surveys: int = SURVEYS_PER_JUMP) -> list[dict[str, Any]]:
    """Measure rendered jumps with drawn surveys and set the errors beside their sigmas.

    Args:
        seconds: about how long to begin jumps; one jump of each scenario at least.
        each: applies a function to all of its arguments, in order, here or elsewhere.
        surveys: of each jump.

    Returns:
        Cases with name and the figures of `Judged`, of which "honesty" gives mean squared normalized errors, the share
        within 2 sigma, and the mean sigma over the scatter.
    """
    return [_case(name, seconds / len(SCENARIOS), each, surveys) for name in SCENARIOS]


def _case(name: str, seconds: float, each: Each, surveys: int) -> dict[str, Any]:
    judged = Judged()
    jumps = found = 0
    for of_jump, times in each(partial(_jump, surveys), _drawn(name, seconds)):
        judged.add(of_jump)
        found += times
        jumps += 1
    draws = jumps * surveys
    return {"name": f"{name}: {jumps} jumps, {draws} surveys", "found": found, "draws": draws, **judged.figures()}


def _drawn(name: str, seconds: float) -> Iterator[Scenario]:
    """Jumps, each another one, as long as there is time; one at least."""
    end = time.monotonic() + seconds
    for jump in count():
        if jump and time.monotonic() >= end:
            return
        yield scenario_of(name, _SEED + jump)


def _jump(surveys: int, scenario: Scenario) -> tuple[Judged, int]:
    """Measure a jump with so many surveys.

    Returns:
        What was found out, and how often a jump was found.
    """
    judged, found = Judged(), 0
    with tempfile.TemporaryDirectory(prefix="svev-bench-") as folder:
        log = write_hill_log(Path(folder) / "jump", scenario, PULSES)
        seen = look(log.path, static_images(log.path))
        for draw in range(surveys):
            _draw_survey(log, scenario, draw)
            found += measured(log, judged, seen)
    return judged, found


def _draw_survey(log: HillLog, scenario: Scenario, draw: int) -> None:
    """Write another survey of a log's hill, with other errors."""
    seed = scenario.seed * SURVEYS_PER_JUMP + draw
    log.survey.write_text(json.dumps(survey(scenario.model_copy(update={"seed": seed}))), encoding="utf-8")
