"""The measuring of whole logs after their recording, in the form of the REST API."""

from datetime import datetime
from enum import StrEnum

from pydantic import Field

from rig.api.fields import Model
from rig.api.jump import LastJump
from rig.api.statement import Statement


class MeasuringState(StrEnum):
    """How far the measuring of a log is."""

    NONE = "none"  #: nobody has asked for it
    WAITING = "waiting"  #: for another log, or for the end of its recording
    MEASURING = "measuring"
    DONE = "done"
    FAILED = "failed"


class MeasuringStep(StrEnum):
    """What is being done with a log."""

    BALLS = "balls"  #: the balls are measured, and the cameras oriented by them
    SEARCH = "search"  #: the jumper is looked for
    NAMES = "names"  #: points and skis get their names
    COMPUTING = "computing"
    WRITING = "writing"
    VIDEO = "video"
    COPYING = "copying"
    RENAMING = "renaming"  #: the session was corrected: the files that say whose jump it is are written anew


class AfterStep(StrEnum):
    """What is done with a log after its end, in this order."""

    MEASURE = "measure"
    VIDEO = "video"  #: an MP4 file with the stick figure
    COPY = "copy"  #: of log and result, to the folder that the rig file names


class StepState(Model):
    """How far one of these is."""

    step: AfterStep
    state: MeasuringState
    problem: Statement | None = Field(None, description="why it failed, and what to do")


class Measurement(Model):
    """What is known of the jumps of a recording."""

    recording: str = Field(description="id of the recording")
    state: MeasuringState
    paused: bool = Field(False, description="the measuring stands still while a recording runs")
    step: MeasuringStep | None = Field(None, description="what is being done")
    share: float = Field(0.0, description="of this step that is done, 0 to 1")
    before: int = Field(0, description="logs that are measured before this one")
    problem: Statement | None = Field(None, description="why it could not be measured, and what to do")
    again: bool = Field(
        False, description="survey or poses kept it from being measured: it is measured again when their file changes"
    )
    refused: Statement | None = Field(
        None, description="why it cannot be measured at all: the rig file has no `[analysis]`; null: it can be"
    )
    steps: tuple[StepState, ...] = Field((), description="what is done with the log, in order, and how far each is")
    measured: datetime | None = Field(None, description="when the log was measured, UTC")
    version: str = Field("", description="of svev, that measured it")
    jumps: tuple[dict[str, object], ...] | None = Field(
        None, description="its jumps as in the `jumper.json` (svev-jumper/1) of the result; null: not asked for"
    )
    figures: tuple[LastJump, ...] = Field((), description="main figures of its jumps")
    live: bool = Field(False, description="the figures are those that were measured live, before the log was closed")
    files: tuple[str, ...] = Field((), description="names of the files of the result")
    renaming: bool = Field(
        False,
        description="the session was corrected since: `report.html`, `jumper.json` and the kinogram are written anew "
        "with it; until then they are not among the files",
    )


class MeasuringQueue(Model):
    """The logs that are being measured, or wait for it."""

    recording: str | None = Field(None, description="id of the one that is being measured; null: none")
    state: MeasuringState = MeasuringState.NONE
    paused: bool = Field(False, description="it stands still while a recording runs")
    step: MeasuringStep | None = None
    share: float = Field(0.0, description="of this step that is done, 0 to 1")
    waiting: int = Field(0, description="so many more wait")
