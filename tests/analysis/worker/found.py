"""What a live analysis has found, for tests."""

from dataclasses import dataclass, field
from typing import Any

from analysis.worker.findings import MeasuredJump
from rig.jumper import JumperState


@dataclass
class Found:
    """See `analysis.worker.findings.Findings`."""

    states: list[JumperState] = field(default_factory=list)
    jumps: list[MeasuredJump] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    def state(self, state: JumperState) -> None:
        self.states.append(state)

    def jump(self, jump: MeasuredJump) -> None:
        self.jumps.append(jump)

    def message(self, level: Any, said: Any) -> None:
        self.said.append(f"{level}: {said}")

    def scene(self, *args: Any) -> None: ...

    def cameras(self, *args: Any) -> None: ...

    def oriented(self, *args: Any) -> None: ...
