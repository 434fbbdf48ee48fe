"""The live analysis notices a knocked camera while frames come, and orients the cameras anew."""

from pathlib import Path

import numpy as np
import pytest

from analysis.cameras.oriented_scene import OrientedScene
from analysis.worker.findings import MeasuredJump
from analysis.worker.live import LiveAnalysis
from analysis.worker.stream import Received
from bench.analysis.hill_logs import write_hill_log
from recorder.reading.triplets import triplets
from rig.clocks import UtcNs
from rig.events import Level
from rig.jumper import JumperState
from rig.phrase import Phrase
from rig.pulse import PulseNumber
from simrig.world.scenario import Scenario
from tests.analysis.simulated import training

RATE_HZ = 5.0
KNOCK_S, LAST_S = 11.0, 21.0
TURN_DEG = 0.05


class Told:
    """What was told."""

    def __init__(self) -> None:
        self.messages: list[tuple[Level, str]] = []
        self.jumps: list[object] = []

    def message(self, level: Level, said: Phrase) -> None:
        """Something to know."""
        self.messages.append((level, said.text))

    def state(self, state: JumperState) -> None:
        """A state."""
        self.jumps.append(state)

    def scene(self, recording: str, pulse: PulseNumber, time: UtcNs, scene: bytes) -> None:
        """A scene."""

    def cameras(self, recording: str, pulse: PulseNumber, time: UtcNs, frames: bytes) -> None:
        """Where cameras stand."""

    def oriented(self, recording: str, time: UtcNs, scene: OrientedScene) -> None:
        """The cameras were oriented."""

    def jump(self, jump: MeasuredJump) -> None:
        """A whole jump."""
        self.jumps.append(jump)


def knocked() -> Scenario:
    moves = ({"from_s": KNOCK_S, "rotation_deg": [0.0, TURN_DEG, 0.0]},)
    scenario = training()
    cameras = [c.model_dump() | ({"moves": moves} if c.name == "K2" else {}) for c in scenario.cameras]
    return Scenario.model_validate(scenario.model_dump() | {"cameras": cameras, "first_takeoff_s": 100.0})


@pytest.mark.long
def test_a_knock_is_told_once_and_the_cameras_are_oriented_anew(tmp_path: Path) -> None:
    log = write_hill_log(tmp_path / "knocked", knocked(), range(round(LAST_S * RATE_HZ)), rate_hz=RATE_HZ)
    told = Told()
    with LiveAnalysis(log.survey, None, told) as analysis:
        for tag, image in triplets(log.path):
            analysis.take(Received(tag, image))
    warnings = [text for level, text in told.messages if level is not Level.INFO]
    assert len(warnings) == 1, warnings
    assert warnings[0].startswith("camera K2 turned by 0.0"), warnings
    assert warnings[0].endswith("oriented anew")
    size = float(warnings[0].removeprefix("camera K2 turned by ").split()[0])
    assert not told.jumps
    assert np.isclose(size, TURN_DEG, atol=0.003)
