"""Where the balls of the survey should be in a camera's picture, as the REST API tells it."""

from datetime import datetime
from enum import StrEnum

from pydantic import Field

from rig.api.fields import Model
from rig.api.statement import Statement


class BallSource(StrEnum):
    """What the places follow from, the best first."""

    CALIBRATION = "calibration"  #: the poses that the rig file names
    ORIENTATION = "orientation"  #: the live analysis, when it oriented the camera last
    SURVEY = "survey"  #: the approximate pose in the survey
    PLAN = "plan"  #: the planned station and direction


class BallPlace(Model):
    """A ball in a picture; (0, 0) is the centre of the top-left pixel, x to the right, y down."""

    name: str
    x: float | None = Field(None, description="px, also beyond the picture; null: the ball is behind the camera")
    y: float | None = Field(None, description="px, likewise")
    sigma: tuple[float, float] | None = Field(
        None,
        description="standard deviations of x and y, px, from those of pose and ball; null: not known, or the ball is "
        "not in the picture",
    )
    inside: bool = Field(description="whether the ball is in the picture")
    seen: bool | None = Field(
        None, description="whether it was found in the pictures that oriented the camera; null: not oriented"
    )


class CameraBalls(Model):
    """Where a camera should show the balls."""

    camera: str
    width: int = Field(description="of its pictures, px")
    height: int
    source: BallSource | None = Field(None, description="what the places follow from; null: they are not known")
    file: str | None = Field(None, description="name of the file with poses, survey or plan")
    oriented: datetime | None = Field(None, description="when the live analysis oriented the camera")
    recording: str | None = Field(None, description="id of the recording in which it did")
    balls: tuple[BallPlace, ...] = ()
    statement: Statement | None = Field(
        None, description="why the places are not known, or only from the plan, and what to do"
    )
