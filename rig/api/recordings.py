"""Recordings in the form of the REST API: orders to begin and end them, whom they are of, what became of them."""

from collections import Counter
from collections.abc import Iterable
from datetime import datetime
from enum import StrEnum
from typing import Final

from pydantic import AwareDatetime, Field, StrictBool

from rig.api.fields import Line, Model, Tag, Text, WholeNumber
from rig.api.statement import Level, Statement
from rig.frame import FrameStatus
from rig.pulse import PulseNumber


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


class SessionFields(Model):
    """Who jumped, and the conditions; all fields are free text and optional."""

    athlete: Line = Field("", examples=["Ola Nordmann"])
    bib: Line = Field("", examples=["17"])
    gate: Line = Field("", examples=["12"])
    wind: Line = Field("", examples=["0.8 m/s head wind"])
    notes: Text = Field("", examples=["new boots"])
    operator: Line = Field("", examples=["Kari"])


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
    parts: tuple[str, ...] = Field((), description="ids of the logs that the recording is split into, in their order")


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
