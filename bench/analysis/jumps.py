"""Measures rendered jumps: how long it takes, how much is solved, how large the errors are beside their sigmas."""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2

from analysis.cameras.source import read_source
from analysis.procedure.analyze import SeenLog, analyze
from bench.analysis.hill_logs import HillLog, write_hill_log
from bench.analysis.judge import Judged
from recorder.reading.triplets import triplets
from rig.settings.file import CONFIG
from simrig.world.scenario import Scenario, load_scenario

#: Hill pulses of one jump at 30 Hz: two seconds in which the jumper comes, flies and leaves.
PULSES = range(15, 75)
#: Shipped scenarios with jumps to be measured.
SCENARIOS = ("training", "hard")


def run_jumps(seconds: float) -> list[dict[str, Any]]:
    """Measure jumps of the shipped scenarios, each time another jump of another survey.

    Args:
        seconds: about how long to go on; one jump of each scenario at least.

    Returns:
        Cases with name, value, unit, baseline and what the baseline is, and the figures of `Judged`.
    """
    return [_case(name, seconds / len(SCENARIOS)) for name in SCENARIOS]


def scenario_of(name: str, seed: int) -> Scenario:
    """A shipped scenario as another seed draws its jumper, its noise and the errors of its survey; without a stamp."""
    return load_scenario(CONFIG / "scenarios" / f"{name}.toml").model_copy(update={"stamp": False, "seed": seed})


def _case(name: str, seconds: float) -> dict[str, Any]:
    judged, took, baseline = Judged(), 0.0, 0.0
    jumps = found = 0
    said = []
    stages = Stages()
    end = time.monotonic() + seconds
    with tempfile.TemporaryDirectory(prefix="svev-bench-") as folder:
        while not jumps or time.monotonic() < end:
            log = write_hill_log(Path(folder) / f"{name}-{jumps}", scenario_of(name, 1000 + jumps), PULSES)
            stages.begin()
            took += cpu_s(lambda log=log: said.append(measured(log, judged, told=stages.told)))  # type: ignore[misc]
            baseline += cpu_s(lambda log=log: _subtract_background(log.path))  # type: ignore[misc]
            log.path.unlink()
            jumps += 1
            found += said[-1]
    return {
        "name": f"{name}, {len(PULSES)} pulses of three VGA cameras, whole analysis",
        "value": round(took / jumps, 2),
        "unit": "CPU-s",
        "baseline": round(baseline / jumps, 2),
        "baseline_is": "reading the log and OpenCV's background subtraction alone",
        "jumps": jumps,
        "found": found,
        "stages_cpu_s": {step: round(spent / jumps, 2) for step, spent in stages.spent.items()},
        **judged.figures(),
    }


class Stages:
    """CPU time of the steps of an analysis.

    Attributes:
        spent: by step in words, s.
    """

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}
        self.begin()

    def begin(self) -> None:
        """The next analysis begins."""
        self._last = time.process_time()

    def told(self, step: str, _share: float) -> None:
        """What was done since the last call belongs to this step."""
        now = time.process_time()
        self.spent[step] = self.spent.get(step, 0.0) + now - self._last
        self._last = now


def measured(
    log: HillLog, judged: Judged, seen: SeenLog | None = None, told: Callable[[str, float], None] | None = None
) -> int:
    """Analyze a log and judge what was measured.

    Args:
        log: the log.
        judged: takes what was measured.
        seen: what was found in its images before.
        told: the progress of the analysis.

    Returns:
        The number of jumps found.
    """
    result = analyze(log.path, read_source(log.survey, None), seen=seen, progress=told).result
    for jump in result.jumps:
        judged.jump(jump, log.truth)
    return len(result.jumps)


def cpu_s(work: Callable[[], object]) -> float:
    """Seconds of CPU that some work takes in this process, all threads together."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def _subtract_background(log: Path) -> None:
    subtractor = cv2.createBackgroundSubtractorMOG2()
    for _, image in triplets(log):
        subtractor.apply(image)
