"""The entries of a `svev-jumper/1` file as they are read: types and sizes are checked, unknown members are skipped."""

from typing import Annotated, Any, Final, Literal

import msgspec
import numpy as np
from msgspec import Meta, Struct, field

from analysis.result.fates import Fate, ImageFate, PartFate
from analysis.result.model import (
    QUANTITIES,
    BallResult,
    CameraMove,
    CameraOffset,
    Jump,
    JumperState,
    MeasuredRecording,
    OrientationResult,
    OrientedImage,
    Phase,
    PointState,
    PulseState,
    Quantity,
    RayTest,
    SkiState,
    SmoothedState,
    Status,
    TakeOff,
    Vector,
    Verdict,
)
from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.phrase import Phrase, plain
from rig.pulse import PulseNumber

FORMAT: Final = "svev-jumper/1"

Triple = tuple[float, float, float]
Matrix = tuple[Triple, Triple, Triple]
#: Null stands for what is not finite.
Number = float | None
Numbers = tuple[Number, Number, Number]
Sigma = Annotated[float, Meta(ge=0.0)]
TimeNs = Annotated[str, Meta(pattern=r"^-?\d{1,20}$")]


class QuantityEntry(Struct):
    """A value with its standard deviation."""

    value: float
    sigma: Sigma


class VectorEntry(Struct):
    """A vector with its covariance."""

    value: Triple
    covariance: Matrix


class PointEntry(Struct):
    """One of `points`."""

    xyz: Triple = field(name="X")
    covariance: Matrix
    cameras: list[str]
    status: Status
    contradicted: bool = False


class SkiEntry(Struct):
    """One of `skis`."""

    direction: Triple
    slope: QuantityEntry
    heading: QuantityEntry
    correlation: Annotated[float, Meta(ge=-1.0, le=1.0)]
    cameras: list[str]
    status: Status


class StateEntry(Struct):
    """The members that the raw and the smoothed part of a pulse have in common."""

    points: dict[str, PointEntry | None]
    skis: dict[str, SkiEntry | None]
    angles: dict[str, QuantityEntry | None]
    height: QuantityEntry | None
    speed: QuantityEntry | None


class SmoothedEntry(StateEntry):
    """`smoothed`."""

    velocity: VectorEntry
    angle_of_attack: QuantityEntry | None
    origin: VectorEntry
    by_calibration: Annotated[list[list[float] | None], Meta(min_length=len(QUANTITIES), max_length=len(QUANTITIES))]


class FateEntry(Struct):
    """One of `fates`."""

    fate: Fate
    images: dict[str, ImageFate]


class PulseEntry(StateEntry):
    """One of `pulses`."""

    pulse: int
    time_ns: TimeNs
    since_takeoff_s: Number
    phase: Phase
    smoothed: SmoothedEntry | None
    fates: dict[str, FateEntry] = {}


class TakeOffEntry(Struct):
    """`takeoff`."""

    pulse: float
    sigma_pulses: Sigma
    time_ns: TimeNs


class VerdictEntry(Struct):
    """`verdict`."""

    ok: bool
    message: str
    phases: dict[Phase, dict[str, Any]]
    said: tuple[Phrase, ...] = ()


class RayTestEntry(Struct):
    """One of `tests`."""

    pulse: int
    camera: str
    what: str
    residual_px: Number
    w: Number
    removed: bool


class JumpEntry(Struct):
    """One of `jumps`."""

    number: int
    takeoff: TakeOffEntry | None
    verdict: VerdictEntry
    pulses: list[PulseEntry]
    tests: list[RayTestEntry]


class ImageEntry(Struct):
    """One of `images` of the orientation."""

    position: Triple = field(name="X0")
    rotation: Matrix = field(name="R")
    sigma_position: Numbers = field(name="sigma_X0")
    sigma_angles: Numbers


class BallEntry(Struct):
    """One of `balls`."""

    role: str
    xyz: Numbers = field(name="X")
    sigma: Numbers
    images: dict[str, tuple[Number, Number, Number, Number]]


class MoveEntry(Struct):
    """One of `moved`."""

    camera: str
    message: str
    rotation_deg: Numbers
    shift_m: Numbers
    p: Number
    said: Phrase | None = None


class OrientationEntry(Struct):
    """`orientation`."""

    images: dict[str, ImageEntry]
    balls: dict[str, BallEntry]
    moved: list[MoveEntry]
    messages: list[str]
    parameters: list[str]
    covariance: list[list[float]]
    source: str
    given: str = ""
    given_covariance: list[list[float]] | None = None


class OffsetEntry(Struct):
    """One of `synchrony`."""

    offset_ms: Number
    sigma_ms: Number
    message: str | None
    said: Phrase | None = None


class FileEntry(Struct):
    """The whole file."""

    format: Literal["svev-jumper/1"]
    recording: str
    session: dict[str, str]
    rate_hz: Annotated[float, Meta(gt=0.0)]
    length_unit: Literal["m"]
    angle_unit: Literal["deg"]
    orientation: OrientationEntry
    synchrony: dict[str, OffsetEntry]
    jumps: list[JumpEntry]


def decoded(content: bytes) -> MeasuredRecording:
    """The measured recording that a file holds.

    Raises:
        ValueError: it holds something else; the message is one line that says where.
    """
    entry = msgspec.json.decode(content, type=FileEntry)
    orientation = _orientation(entry.orientation)
    count = len(orientation.parameters)
    return MeasuredRecording(
        entry.recording,
        entry.session,
        entry.rate_hz,
        orientation,
        {
            name: CameraOffset(_number(o.offset_ms), _number(o.sigma_ms), _said(o))
            for name, o in entry.synchrony.items()
        },
        tuple(_jump(jump, count) for jump in entry.jumps),
    )


def _said(entry: OffsetEntry) -> Phrase | None:
    """What is said of a camera's lateness, with its code where the file has it."""
    return entry.said or (None if entry.message is None else plain(entry.message))


def _orientation(entry: OrientationEntry) -> OrientationResult:
    count = len(entry.parameters)
    return OrientationResult(
        {
            name: OrientedImage(
                np.array(i.position), np.array(i.rotation), _numbers(i.sigma_position), _numbers(i.sigma_angles)
            )
            for name, i in entry.images.items()
        },
        {
            name: BallResult(
                ball.role,
                _numbers(ball.xyz),
                _numbers(ball.sigma),
                {camera: _numbers(xy) for camera, xy in ball.images.items()},
            )
            for name, ball in entry.balls.items()
        },
        tuple(
            CameraMove(
                m.camera, m.said or plain(m.message), _numbers(m.rotation_deg), _numbers(m.shift_m), _number(m.p)
            )
            for m in entry.moved
        ),
        tuple(entry.messages),
        tuple(entry.parameters),
        _matrix(entry.covariance, count, "covariance"),
        entry.source,
        entry.given,
        None if entry.given_covariance is None else _matrix(entry.given_covariance, count, "given_covariance"),
    )


def _matrix(rows: list[list[float]], count: int, name: str) -> Floats:
    if [len(row) for row in rows] != [count] * count:
        raise ValueError(f'orientation: "{name}" is no matrix of {count} rows and columns, one for each parameter')
    return np.array(rows, float).reshape(count, count)


def _jump(entry: JumpEntry, parameters: int) -> Jump:
    takeoff, verdict = entry.takeoff, entry.verdict
    return Jump(
        entry.number,
        None if takeoff is None else TakeOff(takeoff.pulse, takeoff.sigma_pulses, UtcNs(takeoff.time_ns)),
        Verdict(verdict.ok, verdict.message, verdict.phases, verdict.said),
        tuple(_pulse(pulse, parameters) for pulse in entry.pulses),
        tuple(
            RayTest(PulseNumber(t.pulse), t.camera, t.what, _number(t.residual_px), _number(t.w), t.removed)
            for t in entry.tests
        ),
    )


def _pulse(entry: PulseEntry, parameters: int) -> PulseState:
    return PulseState(
        PulseNumber(entry.pulse),
        UtcNs(entry.time_ns),
        _number(entry.since_takeoff_s),
        entry.phase,
        JumperState(*_state(entry)),
        None if entry.smoothed is None else _smoothed(entry.smoothed, entry.pulse, parameters),
        {what: PartFate(part.fate, part.images) for what, part in entry.fates.items()},
    )


def _smoothed(entry: SmoothedEntry, pulse: int, parameters: int) -> SmoothedState:
    rows = [row if row is not None else [np.nan] * parameters for row in entry.by_calibration]
    if any(len(row) != parameters for row in rows):
        raise ValueError(f'pulse {pulse}: a row of "by_calibration" lacks one number for each of the parameters')
    return SmoothedState(
        *_state(entry),
        origin=_vector(entry.origin),
        velocity=_vector(entry.velocity),
        angle_of_attack=_quantity(entry.angle_of_attack),
        by_calibration=np.array(rows, float).reshape(len(QUANTITIES), parameters),
    )


def _state(
    entry: StateEntry,
) -> tuple[
    dict[str, PointState | None],
    dict[str, SkiState | None],
    dict[str, Quantity | None],
    Quantity | None,
    Quantity | None,
]:
    return (
        {name: None if point is None else _point(point) for name, point in entry.points.items()},
        {side: None if ski is None else _ski(ski) for side, ski in entry.skis.items()},
        {name: _quantity(angle) for name, angle in entry.angles.items()},
        _quantity(entry.height),
        _quantity(entry.speed),
    )


def _point(entry: PointEntry) -> PointState:
    return PointState(
        np.array(entry.xyz), np.array(entry.covariance), tuple(entry.cameras), entry.status, entry.contradicted
    )


def _ski(entry: SkiEntry) -> SkiState:
    return SkiState(
        np.array(entry.direction),
        Quantity(entry.slope.value, entry.slope.sigma),
        Quantity(entry.heading.value, entry.heading.sigma),
        entry.correlation,
        tuple(entry.cameras),
        entry.status,
    )


def _quantity(entry: QuantityEntry | None) -> Quantity | None:
    return None if entry is None else Quantity(entry.value, entry.sigma)


def _vector(entry: VectorEntry) -> Vector:
    return Vector(np.array(entry.value), np.array(entry.covariance))


def _number(value: Number) -> float:
    return float("nan") if value is None else value


def _numbers(values: tuple[Number, ...]) -> Floats:
    return np.array([_number(value) for value in values])
