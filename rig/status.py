"""The state of a running service and of its recordings, in the form that the REST API gives to people and programs.

The service makes these objects; the REST API sends them as JSON and refuses unknown fields in those that it receives.
Texts for people come with a `code`, so that the page can say the same in another language.
"""

from collections import Counter
from collections.abc import Iterable
from datetime import datetime
from enum import StrEnum
from typing import Annotated, Final, Literal

from pydantic import AwareDatetime, BaseModel, BeforeValidator, ConfigDict, Field, StrictBool

from rig.frame import FrameStatus
from rig.phrase import Phrase, Value
from rig.pulse import PulseNumber


class Model(BaseModel):
    """Base of all models: unknown fields are errors, instances are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _no_other_type(value: object) -> object:
    if isinstance(value, bool | str):
        raise ValueError("Input should be a valid integer")  # noqa: TRY004 - pydantic makes an answer of a ValueError
    return value


#: Makes an integer what JSON schema understands by it: 3.0 is one, true and "3" are none. Stands behind limits.
WHOLE: Final = BeforeValidator(_no_other_type)
WholeNumber = Annotated[int, WHOLE]


class State(StrEnum):
    """What the service is doing: `idle -> arming -> armed <-> recording`, `fault` from anywhere, `disarming`."""

    IDLE = "idle"
    ARMING = "arming"
    ARMED = "armed"
    RECORDING = "recording"
    DISARMING = "disarming"
    FAULT = "fault"


class Level(StrEnum):
    """Severity of a statement."""

    GOOD = "good"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class Statement(Model):
    """One sentence for people, with what to do.

    Attributes:
        level: severity.
        code: stable name of the statement, for translation, e.g. `camera_absent`.
        text: the statement in English, one line.
        advice: what to do about it, empty if nothing.
        values: names and numbers in the text, for translation, e.g. `{"camera": "K2"}`; also sentences with codes of
            their own, e.g. why a recording ended.
    """

    level: Level = Level.INFO
    code: str
    text: str
    advice: str = ""
    values: dict[str, Value] = {}

    @property
    def said(self) -> Phrase:
        """The statement without its level and advice."""
        return Phrase(self.code, self.text, self.values)


class CameraState(StrEnum):
    """State of a camera's connection."""

    OFF = "off"  #: the rig is not armed
    CONNECTING = "connecting"
    READY = "ready"  #: connected and set up; frames come when pulses come
    SILENT = "silent"  #: connected, but frames fail to come while the other cameras deliver
    ABSENT = "absent"


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


class PulseStatus(Model):
    """The trigger pulses of the last second."""

    arriving: bool
    rate_hz: float | None = None
    spread_us: float | None = Field(None, description="median spread of the trigger times within a pulse")
    number: int = Field(0, description="pulses seen since arming")


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


class Causes(Model):
    """Number of missing frames by cause."""

    lost: int = 0
    missed: int = 0
    damaged: int = 0
    absent: int = 0


class Counts(Model):
    """What became of the pulses of a recording."""

    pulses: int = 0
    complete: int = 0
    partial: int = 0
    causes: Causes = Causes()

    @classmethod
    def sum(cls, parts: Iterable["Counts"]) -> "Counts":
        """The counts of several logs together."""
        pulses = complete = partial = 0
        causes: Counter[str] = Counter()
        for part in parts:
            pulses, complete, partial = pulses + part.pulses, complete + part.complete, partial + part.partial
            causes.update(part.causes.model_dump())
        return cls(pulses=pulses, complete=complete, partial=partial, causes=Causes(**causes))


class ProcessStatus(Model):
    """One row of the process table."""

    name: str
    pid: int | None
    restarts: int = 0
    statement: Statement | None = None


LONGEST_LINE: Final = 200
Line = Annotated[str, Field(max_length=LONGEST_LINE, pattern=r"^[^\x00-\x1f\x7f]*$")]
Text = Annotated[str, Field(max_length=4000, pattern=r"^[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$")]


class SessionFields(Model):
    """Who jumped, and the conditions; all fields are free text and optional."""

    athlete: Line = Field("", examples=["Ola Nordmann"])
    bib: Line = Field("", examples=["17"])
    gate: Line = Field("", examples=["12"])
    wind: Line = Field("", examples=["0.8 m/s head wind"])
    notes: Text = Field("", examples=["new boots"])
    operator: Line = Field("", examples=["Kari"])


LONGEST_TAG: Final = 40
Tag = Annotated[str, Field(min_length=1, max_length=LONGEST_TAG, pattern=r"^[^\x00-\x1f\x7f,]*$")]


class SessionChange(Model):
    """Session fields to change, and marks for finding the recording again; what is left out stays as it is."""

    athlete: Line | None = Field(None, examples=["Ola Nordmann"])
    bib: Line | None = Field(None, examples=["18"])
    gate: Line | None = Field(None, examples=["11"])
    wind: Line | None = Field(None, examples=["calm"])
    notes: Text | None = Field(None, examples=["fell after landing"])
    operator: Line | None = Field(None, examples=["Kari"])
    tags: tuple[Tag, ...] | None = Field(None, max_length=20, examples=[["fall", "new boots"]])
    favourite: StrictBool | None = Field(None, examples=[True])

    def texts(self) -> dict[str, str]:
        """The changes as they stand in a log's session, where every value is text."""
        marks: dict[str, str] = {}
        if self.tags is not None:
            marks["tags"] = ",".join(dict.fromkeys(tag.strip() for tag in self.tags))
        if self.favourite is not None:
            marks["favourite"] = "yes" if self.favourite else ""
        return self.model_dump(include=set(SessionFields.model_fields), exclude_none=True) | marks

    def fields(self) -> "SessionChange":
        """The same change without the marks."""
        return self.model_copy(update={"tags": None, "favourite": None})


class NextJumper(Model):
    """Whom the next recording is of. There is one, which everybody sees and may edit."""

    number: int = Field(0, description="counts up whenever somebody else is next; edits say whom they are about by it")
    version: int = Field(0, description="counts up with every change of the next jumper or of the start list")
    line: int | None = Field(None, description="id of his line in the start list; null: he stands in none")
    following: int | None = Field(None, description="line that follows, if he stands in none and was put before it")
    session: SessionFields = SessionFields()
    more: dict[str, str] = Field({}, description="what the start list has of him beside the session fields, by column")


_SEEN: Final = (
    "`guard.number` of the status that the operator saw when he pressed the button: the call is refused if the state "
    "has changed since, or only just before. Programs that know what they want leave it out."
)


class RecordingOrder(SessionFields):
    """Start of a recording.

    `preroll_s` reaches into the past, as far as triplets are held; `duration_s` counts from now and ends the
    recording by itself. `{"preroll_s": 5, "duration_s": 0}` saves what has just happened.
    """

    preroll_s: float | None = Field(
        None, ge=0, le=600, allow_inf_nan=False, description="left out: all that is held", examples=[5.0]
    )
    duration_s: float | None = Field(
        None,
        ge=0,
        le=86400,
        allow_inf_nan=False,
        description="left out: until stopped, at most `recorder.longest_s` of the rig file",
        examples=[10.0],
    )
    seen: WholeNumber | None = Field(None, description=_SEEN, examples=[None])


class ArmOrder(Model):
    """How the rig is to be armed."""

    min_cameras: WholeNumber | None = Field(
        None,
        ge=1,
        le=8,
        description="so many cameras are enough this time, until the rig is disarmed; left out: as the rig file says",
        examples=[None],
    )


class StopOrder(Model):
    """How a recording is to be stopped."""

    seen: WholeNumber | None = Field(None, description=_SEEN, examples=[None])
    confirm: StrictBool = Field(
        False,
        description="stop also in the first seconds, which a call with `seen` is refused otherwise; the seconds before "
        "the stop stay in memory for the next recording, and its jumper stays the next one",
        examples=[False],
    )


class RecordingState(StrEnum):
    """State of a recording."""

    RECORDING = "recording"
    FINISHED = "finished"
    UNFINISHED = "unfinished"  #: never closed: power loss or a killed recorder; readable to its last second
    DAMAGED = "damaged"  #: some of it cannot be read


class Recording(Model):
    """One recording of the catalogue."""

    id: str
    state: RecordingState
    started: datetime | None = Field(description="time of the first pulse, UTC")
    duration_s: float
    bytes: int
    counts: Counts
    session: SessionFields
    verdict: Statement
    deleted: bool = False
    favourite: bool = False
    tags: tuple[str, ...] = ()
    more: dict[str, str] = Field(
        {}, description="what the start list had of the jumper beside the session fields: round, club, own columns"
    )
    continues: str = Field("", description="id of the recording of which this is the next part; empty: of none")
    continued_by: str = Field("", description="id of the recording that is the next part of this one; empty: none here")


class Sorting(StrEnum):
    """The order of a list of recordings."""

    NEWEST = "newest"
    OLDEST = "oldest"
    BIB = "bib"  #: numbers by their value, before everything else
    ATHLETE = "athlete"
    LONGEST = "longest"


class RecordingQuery(Model):
    """Which recordings to list: those that fit everything that is given."""

    deleted: bool = False
    search: str = ""
    athlete: str = ""
    bib: str = ""
    since: AwareDatetime | None = None
    until: AwareDatetime | None = None
    verdict: Level | None = None
    tag: str = ""
    favourite: bool | None = None
    sort: Sorting = Sorting.NEWEST
    offset: int = 0
    limit: int | None = None


class Trash(Model):
    """What lies in the trash, or was removed from it for good."""

    recordings: int
    bytes: int = Field(description="room on the disk that their removal gives")


class PulseSummary(Model):
    """What became of one pulse of a recording, for scrubbing."""

    pulse: PulseNumber
    time_s: float = Field(description="since the first pulse")
    statuses: tuple[FrameStatus, ...] = Field(description="by camera, left to right")


class Pulses(Model):
    """The pulses of a recording."""

    id: str
    cameras: tuple[str, ...]
    columns: tuple[tuple[int, int], ...] = Field(description="first and one past the last column by camera")
    shape: tuple[int, int] = Field(description="rows and columns of the triplet")
    pulses: tuple[PulseSummary, ...]


class MeasuredValue(Model):
    """A number with its standard deviation."""

    value: float
    sigma: float


class LastJump(Model):
    """Main figures of the jump that was measured last, m/s and degrees; null where not measured."""

    recording: str
    jump: int = Field(description="number of the jump in the recording")
    time: datetime = Field(description="take-off, or first pulse where that was not found, UTC")
    ok: bool = Field(description="whether the jump was measured well")
    verdict: str = Field(description="the verdict in words")
    takeoff_speed: MeasuredValue | None = None
    perpendicular: MeasuredValue | None = Field(None, description="velocity perpendicular to the table at the take-off")
    speed_20_m: MeasuredValue | None = Field(None, description="speed 20 m behind the edge")
    angle_of_attack: MeasuredValue | None = Field(None, description="0.5 s after the take-off")
    ski_to_body: MeasuredValue | None = Field(None, description="alpha, 0.5 s after the take-off")


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


class Status(Model):
    """Everything about the running service at one moment."""

    state: State
    since: datetime = Field(description="when this state began, UTC")
    statement: Statement = Field(description="the state in plain words, and what to do next")
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
    next_jumper: NextJumper = Field(NextJumper(), description="whom the next recording is of")
    automatic: AutomaticStatus | None = Field(None, description="null: the rig file has no [automatic.motion]")
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
