"""Calibrating cameras by pictures of a printed target, in the form of the REST API."""

from enum import StrEnum
from typing import Annotated

from pydantic import Field, StrictBool

from rig.api.fields import WHOLE, Model
from rig.api.statement import Statement


class CalibratingState(StrEnum):
    """What the helper does."""

    OFF = "off"
    LOOKING = "looking"  #: at live pictures; one in which the target is still in a new pose is kept
    HELD = "held"  #: it waits until the recording has ended
    COMPUTING = "computing"
    DONE = "done"
    FAILED = "failed"


class CalibratingOrder(Model):
    """What was printed by `svev target`, as its options say."""

    anew: StrictBool = Field(
        False, description="begin with no pictures, in another folder; else those that are kept go on"
    )
    columns: Annotated[int, Field(ge=3, le=100), WHOLE] = Field(9, description="squares of the board")
    rows: Annotated[int, Field(ge=3, le=100), WHOLE] = 6
    square_mm: float = Field(30.0, ge=1, le=1000, description="side of its squares")
    target_mm: float = Field(80.0, ge=1, le=1000, description="side of a single target's white square")


class SeenTarget(Model):
    """What the pictures of a camera show."""

    camera: str
    width: int = Field(description="of its pictures, px")
    height: int
    corners: tuple[tuple[float, float], ...] = Field(
        (), description="found in the last picture: x to the right, y down, px; (0, 0) is the centre of the first pixel"
    )
    pictures: int = Field(0, description="that were kept")
    cells: tuple[tuple[int, ...], ...] = Field(
        (), description="corners in each part of the picture in all kept pictures, row by row from the top left"
    )
    missing: tuple[Statement, ...] = Field((), description="what to show next, the most urgent first; empty: enough")


class CalibratedLens(Model):
    """What a calibration says of a camera."""

    camera: str
    good: bool = Field(description="whether it is good enough for 1:1000")
    verdict: Statement
    advice: tuple[Statement, ...] = Field((), description="which pictures would make it better")
    residuals: tuple[tuple[float, float, float, float], ...] = Field(
        (), description="means over parts of the picture: x, y of the part, dx, dy of the residual (px, y down)"
    )


class Calibrating(Model):
    """The helper: what it sees, the kept pictures, the result."""

    state: CalibratingState
    still: bool = Field(False, description="whether the target is still")
    full: bool = Field(False, description="no more pictures are kept: there are as many as an adjustment needs at most")
    folder: str | None = Field(None, description="of the pictures: `svev calibrate --pictures` reads it")
    printed: CalibratingOrder | None = Field(None, description="of what the pictures are; another order begins anew")
    taken: int = Field(0, description="pulses of which pictures were kept")
    cameras: tuple[SeenTarget, ...] = ()
    problem: Statement | None = Field(None, description="why nothing is found or computed, and what to do")
    lenses: tuple[CalibratedLens, ...] = Field((), description="the calibration, once it is computed")
    saved: bool = Field(False, description="whether the rig file names this calibration")
