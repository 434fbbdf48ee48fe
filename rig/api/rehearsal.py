"""A rehearsal as the REST API asks for it and tells of it: how far it is, and what it showed."""

from datetime import datetime
from enum import StrEnum

from pydantic import Field

from rig.api.fields import Model
from rig.api.statement import Statement
from rig.api.status import Finding, RehearsalProgress


class RehearsalOrder(Model):
    """What is to be rehearsed."""

    seconds: float = Field(
        5.0, ge=0.5, le=60, allow_inf_nan=False, description="how much is recorded, seconds", examples=[5.0]
    )


class RehearsalVerdict(StrEnum):
    """What a rehearsal showed."""

    READY = "ready"
    WARNED = "warned"  #: recording works, but something may be lost or slow
    NOT_READY = "not_ready"
    FAILED = "failed"  #: nothing was recorded that could be judged


class Rehearsal(Model):
    """A rehearsal that is over."""

    verdict: RehearsalVerdict
    statement: Statement = Field(description="the verdict in words, and what to do")
    line: str = Field(
        description="figures or the first thing to do in one line, in English, as `svev rehearse` says it"
    )
    ended: datetime = Field(description="when, UTC")
    seconds: float = Field(description="how much was to be recorded")
    pulses: int = Field(0, description="pulses in the recording")
    complete: int = Field(0, description="pulses with a frame of each camera")
    headroom: dict[str, float] = Field(
        {}, description="speed of the disk and of each link over the speed needed, as far as known"
    )
    jumps: int | None = Field(None, description="so many jumps fit on the disk")
    spread_us: float | None = Field(None, description="median spread of the trigger times within a pulse")
    findings: tuple[Finding, ...] = Field((), description="everything that was examined")


class Rehearsals(Model):
    """The rehearsal that runs, and what the last one showed."""

    running: RehearsalProgress | None = Field(description="null: none runs")
    last: Rehearsal | None = Field(description="null: there was none; kept when the service is started again")
