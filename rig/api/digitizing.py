"""Measuring by hand: what a person marks in the images of a recording, and what follows from it in space."""

from enum import StrEnum
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from rig.api.fields import WHOLE, Model
from rig.api.measuring import MeasuringStep
from rig.phrase import Phrase

#: A file of marks that is imported: 100 000 points have some 10 MB.
MARKS_BYTES_MAX: Final = 32 << 20
_LARGEST_PX: Final = 100_000.0

Pixel = Annotated[float, Field(ge=-_LARGEST_PX, le=_LARGEST_PX, allow_inf_nan=False)]
SigmaPx = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Place = tuple[Pixel, Pixel]
Sigmas = tuple[SigmaPx, SigmaPx]
PulseNumber = Annotated[int, Field(ge=0, le=2**53), WHOLE]
Vertex = Annotated[int, Field(ge=0, le=999), WHOLE]
Name = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f\x7f]*$")]
OperatorName = Annotated[
    str, Field(min_length=1, max_length=40, pattern=r"^[\w][\w .\-]*$", description="who measures", examples=["Anna"])
]


class MarkState(StrEnum):
    """What a person says of a thing in an image."""

    MEASURED = "measured"
    GUESS = "guess"  #: has a place, which nothing is computed from
    HIDDEN = "hidden"  #: behind something
    NOT_VISIBLE = "not visible"


class MarkSource(StrEnum):
    """How a place came about. Places that were only predicted are no marks."""

    HAND = "hand"
    REFINED = "refined"  #: by hand, then by the image
    TRACKED = "tracked"  #: followed in the images from marks by hand
    AUTOMATIC = "automatic"  #: as the automatic measurement gave it, and accepted


class Mark(Model):
    """What an operator says of one thing in one image. The vertices of a line are marks of their own."""

    pulse: PulseNumber
    camera: Name
    thing: Name
    vertex: Vertex | None = None
    state: MarkState = MarkState.MEASURED
    xy: Place | None = Field(None, description="px; (0, 0) is the centre of the top-left pixel")
    sigma: Sigmas | None = Field(None, description="px, of x and y; null: that of a click by hand")
    source: MarkSource = MarkSource.HAND


class PlaceAction(Model):
    """Put a thing at a place; `vertex` null appends one to a line."""

    do: Literal["place"]
    pulse: PulseNumber
    camera: Name
    thing: Name
    xy: Place
    vertex: Vertex | None = None
    state: Literal[MarkState.MEASURED, MarkState.GUESS] = MarkState.MEASURED
    sigma: Sigmas | None = None
    source: Literal[MarkSource.HAND, MarkSource.REFINED, MarkSource.AUTOMATIC] = MarkSource.HAND


class StateAction(Model):
    """Say that a thing cannot be measured in an image."""

    do: Literal["state"]
    pulse: PulseNumber
    camera: Name
    thing: Name
    state: Literal[MarkState.HIDDEN, MarkState.NOT_VISIBLE]


class RemoveAction(Model):
    """Take back all that was said of a thing in an image, or one vertex of a line."""

    do: Literal["remove"]
    pulse: PulseNumber
    camera: Name
    thing: Name
    vertex: Vertex | None = None


class UndoAction(Model):
    """Take back the last action, or do again what was taken back."""

    do: Literal["undo", "redo"]


Action = Annotated[PlaceAction | StateAction | RemoveAction | UndoAction, Field(discriminator="do")]


class Estimate(Model):
    """A value with its standard deviation."""

    value: float
    sigma: float


class Touched(Model):
    """What an action changed: one thing in one image."""

    pulse: int
    camera: str
    thing: str


class LineMarks(Model):
    """The marks of a line in an image."""

    state: MarkState
    vertices: list[Mark]


class AutomaticPoint(Model):
    """Where the automatic measurement has a point, px."""

    xy: Place
    sigma: Sigmas


class AutomaticLine(Model):
    """A line as the automatic measurement has it, px."""

    xy: list[Place] = Field(description="all points on it")
    vertices: tuple[Place, Place] = Field(description="two points that say as much of it as all of them")
    across: SigmaPx = Field(description="standard deviation of each of the two across the line")


class SpacePoint(Model):
    """A point in space from its rays."""

    X: tuple[float, float, float] | None = Field(description="m; null: not determined")
    sigma: tuple[float, float, float] | None
    status: str = Field(description="controlled, two rays, one ray, or why it is not determined")
    rays: list[str] = Field(description="cameras whose rays are used")
    residuals: dict[str, Place] = Field(description="measured - computed by camera, px")
    w: dict[str, float] = Field(description="test values by camera; standard normal where nothing is wrong")
    finding: Phrase | None = Field(None, description="a ray that does not fit")


class SideCheck(Model):
    """Whether left and right fit together in three images (trifocal check)."""

    ok: bool | None = Field(description="null: it cannot be told")
    said: Phrase


class SpaceLine(Model):
    """A ski in space from its image lines."""

    slope: Estimate | None
    heading: Estimate | None
    status: str
    w: dict[str, float]
    finding: Phrase | None = Field(None, description="an image line that does not fit")
    sides: SideCheck | None = None


class PredictedPoint(Model):
    """Where a point should be in an image."""

    xy: Place
    ellipse: tuple[float, float, float] = Field(description="semi-axes of one sigma, px, and angle of the first, rad")
    source: Literal["rays", "time"]


class PulseView(Model):
    """Everything about one pulse: marks, what the automatic measurement found, and what follows in space."""

    revision: int
    pulse: int
    marks: dict[str, dict[str, Mark | LineMarks]]
    automatic: dict[str, dict[str, AutomaticPoint | AutomaticLine]]
    space: dict[str, SpacePoint]
    lines: dict[str, SpaceLine]
    predicted: dict[str, dict[str, PredictedPoint]]
    previous: dict[str, dict[str, list[Place]]] = Field(description="the marks of the pulse before")
    figures: dict[str, Estimate] = Field(description="angles in degrees, height in the survey's unit")


class Changed(Model):
    """The answer to an action."""

    revision: int
    undo: int = Field(description="so many actions can be taken back")
    redo: int
    touched: Touched | None
    view: PulseView | None = Field(description="of the pulse that was touched")


class Changes(Model):
    """What has changed since a revision."""

    revision: int
    touched: list[Touched]


class Worst(Model):
    """A ray that fits badly."""

    pulse: int
    camera: str
    thing: str
    w: float


class SessionView(Model):
    """The state of an operator's session."""

    revision: int
    undo: int
    redo: int
    coverage: dict[str, dict[str, dict[int, str]]] = Field(
        description="by thing, camera and pulse: m measured, r refined, t tracked, a automatic, g guess, h hidden, "
        "n not visible"
    )
    worst: list[Worst]
    balls: dict[str, dict[str, Mark]] = Field(description="by camera, the balls that were marked")


class Thing(Model):
    """Something that can be measured."""

    name: str
    kind: Literal["point", "line", "ball"]
    title: str
    group: str = Field(description="jumper, body, balls, or the name of a template of further landmarks")
    colour: str | None = Field(None, description="in which it is drawn, as #rrggbb; null: that of its kind")


class OrientationState(Model):
    """How far the cameras are oriented."""

    state: Literal["none", "working", "done", "failed"]
    message: Phrase | None = None
    findings: tuple[Phrase, ...] = Field((), description="what a person should know of the cameras")


class ViewedCamera(Model):
    """A camera of the log."""

    name: str
    size: tuple[int, int]
    oriented: bool


class JumpSpan(Model):
    """The pulses of the first jump that was measured automatically."""

    first: int
    last: int
    takeoff: int | None


class Opening(Model):
    """What a page needs to begin."""

    recording: str
    rate_hz: float
    cameras: list[ViewedCamera]
    pulses: list[int]
    status: dict[str, str] = Field(
        description="a letter for each pulse: o ok, l lost, m missed, d damaged, a absent", examples=[{"K1": "oom"}]
    )
    things: list[Thing]
    orientation: OrientationState
    operators: list[str]
    jump: JumpSpan | None


class Curve(Model):
    """An epipolar curve in an image, with its band of two sigmas, px."""

    line: list[Place]
    low: list[Place]
    high: list[Place]


class Geometry(Model):
    """What one place in one image means for the others."""

    curves: dict[str, Curve]
    space: SpacePoint | None
    predicted: dict[str, PredictedPoint]


class RefineOrder(Model):
    """Where to look for a thing more exactly."""

    pulse: PulseNumber
    camera: Name
    x: Pixel
    y: Pixel
    end: Place | None = Field(None, description='where a line ends that was drawn from there, px; for "line" only')
    kind: Literal["disc", "dark disc", "edge", "line"]

    @model_validator(mode="after")
    def _ends(self) -> Self:
        if (self.kind == "line") != (self.end is not None):
            raise ValueError('"line" has an "end", and nothing else has: give both or neither')
        if self.end is not None and self.end == (self.x, self.y):
            raise ValueError("the line has no length: draw it longer")
        return self


class Refined(Model):
    """A place found in the image, px."""

    xy: Place
    end: Place | None = Field(None, description="of a line another place on it, whose error is independent")
    sigma: Sigmas
    kind: str


class TrackOrder(Model):
    """What to follow through the images, from where."""

    things: Annotated[list[Name], Field(min_length=1, max_length=100)]
    pulse: PulseNumber
    direction: Literal[1, -1]
    most: Annotated[
        int, Field(ge=0, le=10_000, description="pulses; 0: find skis more exactly at this pulse"), WHOLE
    ] = 30


class Tracking(Model):
    """How far the following of things is, and what it gave."""

    state: Literal["none", "tracking", "done", "failed"]
    share: float = Field(0.0, description="about how much is done, 0 to 1")
    paused: bool = Field(False, description="it stands still while a recording runs")
    problem: Phrase | None = Field(None, description="why nothing was followed, and what to do")
    tracked: dict[str, list[int]] = Field({}, description="by thing, the pulses")
    stopped: dict[str, Phrase] = Field({}, description="by thing, why it ended")


class Suggestion(Model):
    """Where one more click lowers the sigmas most."""

    pulse: int
    camera: str
    thing: str
    why: str


class TapeOrder(Model):
    """Two things of which each is clicked in two images or more."""

    pulse: PulseNumber
    start: dict[Name, Place] = Field(alias="from")
    end: dict[Name, Place] = Field(alias="to")


class CurvePoint(Model):
    """A value of a pulse."""

    pulse: int
    value: float
    sigma: float


class HandCurves(Model):
    """Curves of all quantities from the marks of a session, and how far newer ones are."""

    state: Literal["none", "computing", "done", "failed"]
    revision: int = Field(0, description="of the session from whose marks these curves come")
    paused: bool = Field(False, description="the computing stands still while a recording runs")
    problem: Phrase | None = Field(None, description="why newer ones could not be computed, and what to do")
    said: tuple[Phrase, ...] = Field((), description="the verdicts on its jumps, sentence by sentence")
    curves: dict[str, list[CurvePoint]] = Field({})


class HandResult(Model):
    """How far the computing of a session is, and what it gave."""

    state: Literal["none", "computing", "done", "failed"]
    step: MeasuringStep | None = Field(None, description="what is being done")
    share: float = Field(0.0, description="of this step that is done, 0 to 1")
    paused: bool = Field(False, description="it stands still while a recording runs")
    problem: Phrase | None = Field(None, description="why it could not be computed, and what to do")
    said: tuple[Phrase, ...] = Field((), description="the verdicts on its jumps, sentence by sentence")
    files: tuple[str, ...] = ()


class PointAgreement(Model):
    """How operators agree in the image points of a thing."""

    count: int = Field(description="image points that all of them measured")
    sigma_px: float = Field(description="standard deviation of one click of one operator, in x and y alike")
    bias_px: dict[str, Place] = Field(description="mean of each operator's points minus that of all, px")


class FigureAgreement(Model):
    """How operators agree in a figure, such as an angle."""

    count: int = Field(description="pulses in which all of them have it")
    sigma: float = Field(description="standard deviation of the figure from one operator to another")
    bias: dict[str, float] = Field(description="mean of each operator's figure minus that of all")


class Repeatability(Model):
    """How two or more operators agree in what all of them measured."""

    operators: list[str]
    things: dict[str, PointAgreement]
    figures: dict[str, FigureAgreement] = Field(description="angles in degrees, height in the survey's unit")
    said: tuple[Phrase, ...] = Field(description="the largest scatter, and that of each figure")
