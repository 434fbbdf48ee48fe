"""The recordings that wait to be copied to the other disk, which `[offload]` of the rig file names."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from rig.api.measuring import AfterStep, MeasuringQueue, MeasuringState, MeasuringStep, StepState
from rig.errors import StateForbidsError
from rig.events import Event
from rig.settings.model import RigSettings
from service.measuring.waiting import WaitingLogs
from service.offloading.notes import CopyNotes

#: So often recordings are looked for that are not on the other disk.
_UNCOPIED_LOOK_S: Final = 300.0
#: What is told of several logs, the first that holds of one.
_TOLD: Final = (MeasuringState.MEASURING, MeasuringState.FAILED, MeasuringState.WAITING, MeasuringState.DONE)


class Copies:
    """Any thread may call any method but `look`.

    Args:
        folder: of the recordings.
        in_use: gives the rig in use.
        tell: takes an event for the live log.

    Attributes:
        waiting: the recordings that are to be copied.
        notes: what came of those that were.
    """

    def __init__(self, folder: Path, in_use: Callable[[], RigSettings], tell: Callable[[Event], None]) -> None:
        self._folder, self._in_use = folder, in_use
        self.waiting = WaitingLogs()  # kept in no file: the notes tell what is copied
        self.notes = CopyNotes(folder, tell)
        self._looked: tuple[str, float] | None = None

    def want(self, recording: str) -> None:
        """Let a recording wait, if the rig file asks for copies."""
        if self._in_use().offload is not None:
            with suppress(StateForbidsError):  # two thousand wait: it is found later
                self.waiting.add(recording)

    def look(self) -> None:
        """Let recordings wait that are not on the other disk as they are: now and then, and when that disk comes."""
        offload = self._in_use().offload
        if offload is None or not (offload.to is None or offload.to.is_dir()):
            self._looked = None
            return
        now = time.monotonic()
        if self._looked is not None and self._looked[0] == offload.place and now - self._looked[1] < _UNCOPIED_LOOK_S:
            return
        self._looked = offload.place, now
        for log in sorted(self._folder.glob("*.mcap")):
            if not self.notes.is_copied(log):
                self.want(log.stem)

    def step(self, logs: Sequence[str], running: MeasuringQueue | None) -> tuple[StepState, ...]:
        """How far the copy of a recording is; nothing where none is made.

        Args:
            logs: ids of all its logs.
            running: what is at work.
        """
        steps = [step for log in logs if (step := self._step(log, running)) is not None]
        if any(step.state is MeasuringState.DONE for step in steps) and len(steps) < len(logs):
            steps.append(StepState(step=AfterStep.COPY, state=MeasuringState.WAITING))  # the others have yet to be seen
        return tuple(sorted(steps, key=lambda step: _TOLD.index(step.state))[:1])

    def _step(self, log: str, running: MeasuringQueue | None) -> StepState | None:
        note, problem = self.notes.of(log), None
        if running is not None and (running.recording, running.step) == (log, MeasuringStep.COPYING):
            state = MeasuringState.MEASURING
        elif log in self.waiting:
            state = MeasuringState.WAITING
        elif note is None:
            return None
        else:
            problem = note.problem
            state = MeasuringState.DONE if problem is None else MeasuringState.FAILED
        return StepState(step=AfterStep.COPY, state=state, problem=problem)
