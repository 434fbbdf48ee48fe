"""Recordings that begin by themselves: the call that marks a jump, and what came of it."""

from pydantic import AwareDatetime, Field, StrictBool

from rig.api.fields import Line, Model
from rig.api.recordings import Recording


class JumpMark(Model):
    """Something that happens once per jump: a light barrier, a start gate that opens, a timing system."""

    source: Line = Field("", description="what noticed it; it stands in the log", examples=["light barrier"])
    time: AwareDatetime | None = Field(
        None, description="when it happened, if that was before the call, at most a minute; left out: now"
    )


class Marked(Model):
    """What came of a mark."""

    started: bool = Field(description="whether it began a recording; false: one was running, whose log has the mark")
    recording: Recording


class AutomaticChange(Model):
    """Whether motion is to begin recordings."""

    on: StrictBool = Field(examples=[False])
