"""The state of a running service, in the form that the REST API gives to people and programs.

The service makes these objects; the REST API sends them as JSON and refuses unknown fields in those that it receives.
Texts for people come with a `code`, so that the page can say the same in another language.
"""

from datetime import datetime
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from rig.api.fields import WHOLE, Model
from rig.api.jump import LastJump
from rig.api.measuring import MeasuringQueue
from rig.api.recordings import NextJumper, Recording
from rig.api.statement import Statement
from rig.phrase import Value


class State(StrEnum):
    """What the service is doing: `idle -> arming -> armed <-> recording`, `fault` from anywhere, `disarming`."""

    IDLE = "idle"
    ARMING = "arming"
    ARMED = "armed"
    RECORDING = "recording"
    DISARMING = "disarming"
    FAULT = "fault"


class CameraState(StrEnum):
    """State of a camera's connection."""

    OFF = "off"  #: the rig is not armed
    CONNECTING = "connecting"
    READY = "ready"  #: connected and set up; frames come when pulses come
    SILENT = "silent"  #: connected, but frames fail to come while the other cameras deliver
    ABSENT = "absent"


class ActionAnswers(Model):
    """What a camera has answered to action commands since arming, while it was connected."""

    acknowledged: int = Field(description="commands that it took")
    late: int = Field(description="commands whose time was past when they came")
    refused: int = Field(description="commands that it did not take, e.g. without a reference time")
    unanswered: int = Field(description="commands that it did not answer in time, whether it took them or not")


class CameraStatus(Model):
    """One camera, in the order of the triplet, left to right."""

    name: str
    backend: str
    address: str
    state: CameraState
    statement: Statement
    frames_per_s: float | None = Field(None, description="frames of the last second")
    frames: int = Field(0, description="whole frames since arming")
    damaged: int = Field(0, description="damaged frames since arming")
    resent_packets: int = 0
    reconnects: int = 0
    temperature_c: float | None = None
    clock_offset_us: float | None = Field(None, description="trigger time minus the pulse's, median of late")
    columns: tuple[int, int] | None = Field(None, description="first and one past the last column in the triplet")
    actions: ActionAnswers | None = Field(
        None, description='answers to action commands; null: trigger.source is not "action"'
    )


class MadePulses(Model):
    """The pulses that a line of this computer has made since arming; how late they were against even times."""

    made: int = Field(description="pulses")
    skipped: int = Field(description="pulses that were left out, since they would have come late")
    late_median_us: float | None = Field(description="of the last thousand pulses; null: none was made yet")
    late_p99_us: float | None = Field(description="likewise; 1 of 100 was later")
    late_max_us: float | None = Field(description="the latest of all")
    realtime: bool = Field(description="whether the thread that makes them has a real-time priority")
    gate_open: bool | None = Field(
        None,
        description="whether the gate let the last pulse pass that was due; null: no gate, or no pulse was due yet",
    )


class PulseStatus(Model):
    """The trigger pulses of the last second."""

    arriving: bool
    running: bool = Field(True, description="false: svev has stopped them on request; a recording starts them again")
    rate_hz: float | None = None
    spread_us: float | None = Field(None, description="median spread of the trigger times within a pulse")
    number: int = Field(0, description="pulses seen since arming")
    fired: int | None = Field(
        None, description="pulses that the source says it made since arming; null: it does not tell of its pulses"
    )
    made: MadePulses | None = Field(None, description='null: trigger.source is not "gpio" or "iidc-broadcast"')


class DiskStatus(Model):
    """Room for recordings."""

    free_gb: float
    trash_gb: float = Field(0.0, description="held by the trash; it is made free when the room is needed")
    reserve_gb: float = Field(description="recording stops before less than this is free")
    seconds_left: float = Field(description="so much can still be recorded, with the room of the trash")
    jumps_left: int = Field(description="so many jumps of `jump_s` seconds")
    jump_s: float


class PrerollStatus(Model):
    """The triplets kept in memory while armed."""

    seconds: float = Field(description="held now")
    limit_s: float = Field(description="held at most")
    memory_mb: float = Field(description="memory taken for it")


class ProcessStatus(Model):
    """One row of the process table."""

    name: str
    pid: int | None
    restarts: int = 0
    statement: Statement | None = None


class ArmOrder(Model):
    """How the rig is to be armed."""

    min_cameras: Annotated[int, Field(ge=1, le=8), WHOLE] | None = Field(
        None,
        description="so many cameras are enough this time, until the rig is disarmed; left out: as the rig file says",
        examples=[None],
    )


class Event(Model):
    """One event of the live log."""

    number: int = Field(description="counts up by one; a gap means that events were dropped")
    time: datetime
    level: Literal["debug", "info", "warning", "error", "fatal"]
    name: str = Field(description="who or what it is about, e.g. `recorder`, `K2`")
    message: str = Field(description="what happened, in English")
    code: str = Field("", description="stable name of the message, for translation; empty: there is none")
    values: dict[str, Value] = Field({}, description="names and numbers in the message, for translation")


class TapGuard(Model):
    """What keeps a second tap from undoing the first: see `seen` of the commands."""

    number: int = Field(description="of the present state; counts up with every change of state")
    hold_s: float = Field(description="so long from now calls with `seen` are refused, because the state is new")
    confirm_s: float = Field(description="so long from now the recording is stopped with `confirm` only")


class AutomaticStatus(Model):
    """Whether recordings begin by themselves when something moves."""

    on: bool = Field(description="whether they do at present")
    camera: str = Field(description="whose images are watched")


class RehearsalStage(StrEnum):
    """What a rehearsal is doing."""

    CONNECTING = "connecting"  #: cameras are connected, and pulses awaited
    RECORDING = "recording"
    READING = "reading"  #: the log is read back and judged


class RehearsalProgress(Model):
    """How far a rehearsal is."""

    stage: RehearsalStage
    done: int = Field(0, description="pulses that are recorded")
    pulses: int = Field(0, description="pulses to record; 0: not known yet")


class Alarm(Model):
    """Something that has gone wrong with pulses, clocks or a camera while the rig is armed."""

    number: int = Field(description="counts up with every alarm of this run of the service, also if it gets worse")
    topic: str = Field(description="what may be wrong; of each topic there is one alarm at a time")
    since: datetime = Field(description="when it began, UTC")
    statement: Statement = Field(
        description="what is wrong and what to do, with figures of the last seconds; `level` is warning or error"
    )
    acknowledged: bool = Field(False, description="somebody has seen it: it is silent until it ends and comes anew")


class Status(Model):
    """Everything about the running service at one moment."""

    state: State
    since: datetime = Field(description="when this state began, UTC")
    statement: Statement = Field(description="the state in plain words, and what to do next")
    alarms: tuple[Alarm, ...] = Field(
        (), description="what is wrong with pulses, clocks, cameras and the measuring of jumps, the worst first"
    )
    notice: Statement | None = Field(None, description="what befell the last recording, until the next one")
    guard: TapGuard
    rig: str
    version: str
    cameras: tuple[CameraStatus, ...]
    pulses: PulseStatus
    preroll: PrerollStatus
    disk: DiskStatus
    recording: Recording | None = Field(description="the recording in progress")
    last_recording: str | None = Field(description="id of the recording that ended last")
    last_jump: LastJump | None = Field(None, description="the jump that the analysis measured last")
    measuring: MeasuringQueue = Field(MeasuringQueue(), description="the logs that are being measured")
    next_jumper: NextJumper = Field(NextJumper(), description="whom the next recording is of")
    automatic: AutomaticStatus | None = Field(None, description="null: the rig file has no [automatic.motion]")
    rehearsal: RehearsalProgress | None = Field(None, description="the rehearsal that runs; null: none")
    processes: tuple[ProcessStatus, ...]


class Finding(Model):
    """One finding of the doctor."""

    level: Literal["PASS", "WARN", "FAIL"]
    topic: str
    code: str = Field(description="stable name of the finding, for translation; empty: there is none")
    what: str = Field(description="what was found, in English")
    remedy: str = Field(description="what to do about it, in English; empty if nothing")
    values: dict[str, Value] = Field({}, description="names and numbers in both texts, for translation")


class DoctorReport(Model):
    """All findings of the doctor."""

    worst: Literal["PASS", "WARN", "FAIL"]
    findings: tuple[Finding, ...]


class RigView(Model):
    """The rig file in use."""

    name: str
    toml: str = Field(description="the file as it was read")
    settings: dict[str, object] = Field(description="the settings with all defaults filled in")
