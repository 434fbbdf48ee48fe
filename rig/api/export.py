"""What of a recording is to be exported and how: the words of the command line, the REST API and the program between.

Names of fields are those of the API.
"""

from enum import StrEnum
from typing import Annotated, Final

from pydantic import Field

from rig.api.fields import WHOLE, Model
from rig.api.language import Language
from rig.phrase import Phrase

_CAMERAS_MAX: Final = 8
_PulseNumber = Annotated[int, Field(ge=1, le=2**53), WHOLE]


class Kind(StrEnum):
    """What comes out."""

    H264 = "h264"  #: a video for people: MP4
    FFV1 = "ffv1"  #: a video without loss: Matroska, grey
    PNG = "png"  #: a picture of each frame, and the table
    TIFF = "tiff"  #: the same, for programs that read no PNG
    CSV = "csv"  #: a table: what became of each pulse in each camera
    CONTACT_SHEET = "contact_sheet"  #: a page with triplets of the jump


#: What holds every pixel as it was recorded: of 10- and 12-bit cameras 16 bits, 65535 at the most.
LOSSLESS: Final = frozenset({Kind.FFV1, Kind.PNG, Kind.TIFF})
#: The ending of what comes out, empty for a folder.
ENDINGS: Final = {
    Kind.H264: ".mp4", Kind.FFV1: ".mkv", Kind.PNG: "", Kind.TIFF: "", Kind.CSV: ".csv", Kind.CONTACT_SHEET: ".png",
}  # fmt: skip


class Quality(StrEnum):
    """Of a video for people: the worse, the smaller."""

    SMALL = "small"
    GOOD = "good"
    BEST = "best"


class ExportOrder(Model):
    """What is to be exported."""

    kind: Kind = Field(Kind.H264, description="what comes out")
    cameras: tuple[Annotated[str, Field(min_length=1, max_length=100)], ...] = Field(
        (), max_length=_CAMERAS_MAX, description="these cameras side by side, in this order; none: all"
    )
    first: _PulseNumber | None = Field(None, description="first pulse; null: the first of the recording")
    last: _PulseNumber | None = Field(None, description="last pulse; null: the last of the recording")
    slow: float = Field(1.0, ge=1, le=10, description="so many times slower, for videos")
    quality: Quality = Field(Quality.GOOD, description="of a video for people")
    burn_in: bool = Field(False, strict=True, description="write bib, pulse and time into the pictures of a video")
    language: Language = Field(Language.EN, description="of words in the pictures of a video")


class ExportState(StrEnum):
    """How far an export is."""

    WAITING = "waiting"  #: for another export
    RUNNING = "running"
    PAUSED = "paused"  #: while a recording runs
    DONE = "done"
    FAILED = "failed"


class ExportJob(Model):
    """An export that the service makes."""

    id: str
    recording: str = Field(description="id of the recording")
    order: ExportOrder
    state: ExportState
    done: int = Field(0, description="pulses that are done")
    pulses: int = Field(0, description="pulses to do; 0: not known yet")
    name: str = Field(description="of the file")
    bytes: int = Field(0, description="size of the file when it is done")
    problem: Phrase | None = Field(None, description="why it failed, and what to do")
