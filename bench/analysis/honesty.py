"""Whether the sigmas of measured jumps hold: rendered jumps, each measured with many drawn surveys of the balls."""

import json
import tempfile
import time
from pathlib import Path
from typing import Any, Final

from analysis.procedure.analyze import look
from analysis.scene.static_image import static_images
from bench.analysis.hill_logs import HillLog, write_hill_log
from bench.analysis.judge import Judged
from bench.analysis.jumps import PULSES, SCENARIOS, measured, scenario_of
from simrig.world.scenario import Scenario
from simrig.world.survey import survey

#: Surveys that are drawn for each rendered jump. The jump's own noise is common to them, so that more jumps say more.
SURVEYS_PER_JUMP: Final = 20
_SEED: Final = 5000


def run_honesty(seconds: float) -> list[dict[str, Any]]:
    """Measure rendered jumps with drawn surveys and set the errors beside their sigmas.

    Args:
        seconds: about how long to go on; one jump of each scenario at least.

    Returns:
        Cases with name and the figures of `Judged`, of which "honesty" gives mean squared normalized errors, the share
        within 2 sigma, and the mean sigma over the scatter.
    """
    return [_case(name, seconds / len(SCENARIOS)) for name in SCENARIOS]


def _case(name: str, seconds: float) -> dict[str, Any]:
    judged = Judged()
    jumps = draws = found = 0
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory(prefix="svev-bench-") as folder:
        while not jumps or time.monotonic() < end:
            scenario = scenario_of(name, _SEED + jumps)
            log = write_hill_log(Path(folder) / f"{name}-{jumps}", scenario, PULSES)
            seen = look(log.path, static_images(log.path))
            for draw in range(SURVEYS_PER_JUMP):
                _draw_survey(log, scenario, draw)
                found += measured(log, judged, seen)
                draws += 1
            log.path.unlink()
            jumps += 1
    return {"name": f"{name}: {jumps} jumps, {draws} surveys", "found": found, "draws": draws, **judged.figures()}


def _draw_survey(log: HillLog, scenario: Scenario, draw: int) -> None:
    """Write another survey of a log's hill, with other errors."""
    seed = scenario.seed * SURVEYS_PER_JUMP + draw
    log.survey.write_text(json.dumps(survey(scenario.model_copy(update={"seed": seed}))), encoding="utf-8")
