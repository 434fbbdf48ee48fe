"""Follows a jump live at 30 Hz: how long after its triplet each state is told, and what that costs.

Triplets come at the pace of the cameras by a clock of our own, which goes on by the CPU time that the worker takes: so
the figures are those of a computer that has nothing else to do, however busy this one is. Whole jumps are computed in
another thread, which is counted in the sum but not in the latency.
"""

import tempfile
import time
from pathlib import Path
from typing import Any, Final

import numpy as np

from analysis.cameras.oriented_scene import OrientedScene
from analysis.candidates.finder import Finder
from analysis.scene.static_image import static_images
from analysis.worker.findings import MeasuredJump
from analysis.worker.live import LiveAnalysis
from analysis.worker.stream import Received
from bench.analysis.hill_logs import write_hill_log
from bench.analysis.jumps import cpu_s, scenario_of
from recorder.reading.triplets import triplets
from rig.clocks import UtcNs
from rig.events import Level
from rig.jumper import JumperState
from rig.phrase import Phrase
from rig.pulse import PulseNumber

_RATE_HZ: Final = 30.0
_PULSES: Final = range(75, 345)  #: of the hill: more than four seconds for the static images, then a jump
_BEGIN: Final = 170  #: number in the log from which on the clock goes: between two jumps, the cameras are oriented


class _Told:
    """Notes the pulses whose states are told."""

    def __init__(self) -> None:
        self.pulses: list[PulseNumber] = []
        self.jumps = 0

    def state(self, state: JumperState) -> None:
        """A state."""
        self.pulses.append(state.pulse)

    def jump(self, jump: MeasuredJump) -> None:
        """A whole jump."""
        self.jumps += jump.summary.ok

    def scene(self, recording: str, pulse: PulseNumber, time: UtcNs, scene: bytes) -> None:
        """Of no interest here."""

    def cameras(self, recording: str, pulse: PulseNumber, time: UtcNs, frames: bytes) -> None:
        """Of no interest here."""

    def oriented(self, recording: str, time: UtcNs, scene: OrientedScene) -> None:
        """Of no interest here."""

    def message(self, level: Level, said: Phrase) -> None:
        """Of no interest here."""


def run_live() -> list[dict[str, Any]]:
    """Follow a jump of the shipped scenario.

    Returns:
        Cases with name, value, unit, baseline and what the baseline is.
    """
    with tempfile.TemporaryDirectory(prefix="svev-bench-") as folder:
        log = write_hill_log(Path(folder) / "live", scenario_of("training", 1000), _PULSES)
        told = _Told()
        begin, all_s = time.process_time(), 0.0
        with LiveAnalysis(log.survey, None, told) as analysis:
            late, follow_s, quiet_s = _followed(log.path, analysis, told)
        all_s = time.process_time() - begin
        finder = Finder(static_images(log.path, range(1, round(4 * _RATE_HZ))))
        full_s = cpu_s(lambda: [finder.find(tag, image) for tag, image in triplets(log.path) if tag.pulse in late])
    worst = np.array(list(late.values()))
    everything = {"baseline": round(1000 * full_s / len(late), 1), "baseline_is": "all candidates, nobody followed"}
    pulse = {"baseline": round(1000 / _RATE_HZ, 1), "baseline_is": "one pulse"}
    return [
        _case("30 Hz, three VGA cameras: triplet to state, median", np.median(worst), pulse)
        | {"p90_ms": round(1000 * float(np.quantile(worst, 0.9)), 1), "states": len(worst), "jumps": told.jumps},
        _case("the same, largest", worst.max(), pulse),
        _case("CPU per triplet that is followed", follow_s / len(late), everything),
        _case("CPU per triplet in which nobody is", quiet_s, pulse),
        _case("CPU per triplet, cameras and whole jumps too", all_s / len(_PULSES), pulse),
    ]


def _case(name: str, seconds: float, baseline: dict[str, Any]) -> dict[str, Any]:
    return {"name": name, "value": round(1000 * float(seconds), 1), "unit": "ms", **baseline}


def _followed(log: Path, analysis: LiveAnalysis, told: _Told) -> tuple[dict[int, float], float, float]:
    """Seconds from triplet to state by pulse, of CPU for all of them, and of CPU (median) where nobody is."""
    late: dict[int, float] = {}
    quiet: list[float] = []
    free = follow_s = 0.0
    for tag, image in triplets(log):
        known, begin = len(told.pulses), time.thread_time()
        analysis.take(Received(tag, image))
        took = time.thread_time() - begin
        if tag.pulse < _BEGIN:
            continue
        free = max(free, tag.pulse / _RATE_HZ) + took
        late |= {pulse: free - pulse / _RATE_HZ for pulse in told.pulses[known:]}
        if len(told.pulses) > known:
            follow_s += took
        else:
            quiet.append(took)
    return late, follow_s, float(np.median(quiet))
