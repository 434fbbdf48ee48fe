"""What people look for in a recording: the moment at which it begins to matter, and notes at single pulses."""

from datetime import datetime
from enum import StrEnum
from typing import Annotated, Final

from pydantic import Field

from rig.api.fields import Model

#: All notes of a recording fit into the file of its session fields with room to spare.
NOTE_MAX = 120
#: Some eight minutes of speech as the page records it.
VOICE_BYTES_MAX: Final = 2 << 20
VOICES_MAX: Final = 30
NoteText = Annotated[str, Field(min_length=1, max_length=NOTE_MAX, pattern=r"^[^\x00-\x1f\x7f]*$")]


class MomentKind(StrEnum):
    """How a moment was found."""

    TAKEOFF = "takeoff"  #: the jump was measured
    ACTIVITY = "activity"  #: most moves there
    NONE = "none"  #: nothing moves


class Moment(Model):
    """The pulse at which a viewer opens a recording."""

    pulse: int | None = Field(description="null: nothing moves")
    kind: MomentKind
    from_log: bool = Field(False, description="measured in the whole log, whose jumps can be compared")
    exact: float | None = Field(None, description="the moment between two pulses, if it was measured")


class NewNote(Model):
    """What to note at a pulse."""

    text: NoteText = Field(examples=["ski tip opens"])


class Note(Model):
    """A note at a pulse of a recording."""

    pulse: int
    text: str


class VoiceNote(Model):
    """A spoken note at a pulse of a recording."""

    number: int = Field(description="counts the spoken notes of the recording")
    pulse: int
    recorded: datetime = Field(description="when it was stored, UTC")
    bytes: int
