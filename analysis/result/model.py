"""The measured jump in memory; the file `jumper.json` (`svev-jumper/1`) has the same members.

Lengths m, speeds m/s; angles and their sigmas here in degrees, as in the file. What was not measured is None.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Final

import numpy as np

from analysis.result.fates import PartFate
from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.phrase import Phrase
from rig.pulse import PulseNumber

#: The quantities that the report and comparisons judge, degrees, m, m/s: the rows of `SmoothedState.by_calibration`.
#: The last three are the components of the velocity of O.
QUANTITIES: Final = (
    *("alpha", "beta", "gamma", "dphi", "phi", "angle_of_attack", "height", "speed"),
    *("velocity_x", "velocity_y", "velocity_z"),
)
#: Half the length of the phase "edge": it is within so many seconds of the take-off.
EDGE_S = 0.1


class Status(StrEnum):
    """How far a point or a ski is controlled."""

    CONTROLLED = "controlled"  #: three rays or more
    TWO_RAYS = "two rays"  #: a gross error of one of them does not show
    PREDICTED = "predicted"  #: not measured at this pulse, from the model over time alone
    BY_HAND = "by hand"  #: measured by a person


class Phase(StrEnum):
    """Phases of a jump."""

    TABLE = "table"
    EDGE = "edge"
    FLIGHT = "flight"


def phase_at(since_takeoff_s: float) -> Phase:
    """The phase at a time after the take-off."""
    if abs(since_takeoff_s) <= EDGE_S:
        return Phase.EDGE
    return Phase.TABLE if since_takeoff_s < 0 else Phase.FLIGHT


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number with its standard deviation."""

    value: float
    sigma: float


@dataclass(frozen=True, slots=True, eq=False)
class Vector:
    """A vector (3,) with its covariance (3, 3)."""

    value: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True, eq=False)
class PointState:
    """A point of the jumper.

    Attributes:
        xyz: (3,) m.
        covariance: (3, 3) m^2.
        cameras: that saw it.
        status: how far it is controlled.
        contradicted: of a raw point: the motion of the whole jump says that it is wrong.
    """

    xyz: Floats
    covariance: Floats
    cameras: tuple[str, ...]
    status: Status
    contradicted: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class SkiState:
    """A ski.

    Attributes:
        direction: (3,) unit vector, tail to tip.
        slope: above the horizontal, degrees.
        heading: from X towards Y, degrees.
        correlation: of slope and heading.
        cameras: that saw it.
        status: how far it is controlled.
    """

    direction: Floats
    slope: Quantity
    heading: Quantity
    correlation: float
    cameras: tuple[str, ...]
    status: Status

    @property
    def covariance(self) -> Floats:
        """(2, 2) of slope and heading, rad^2."""
        sigma = np.radians((self.slope.sigma, self.heading.sigma))
        return np.asarray(np.outer(sigma, sigma) * ((1.0, self.correlation), (self.correlation, 1.0)))


@dataclass(frozen=True, slots=True, eq=False)
class JumperState:
    """The jumper at one instant.

    Attributes:
        points: P1 to P4; None where not measured.
        skis: right and left; None where not measured.
        angles: alpha, beta, gamma, dphi, phi, degrees (`photogrammetry.jumper.stick_model`).
        height: Z0, height of O (midpoint of P3 and P4).
        speed: v of O.
    """

    points: Mapping[str, PointState | None]
    skis: Mapping[str, SkiState | None]
    angles: Mapping[str, Quantity | None]
    height: Quantity | None
    speed: Quantity | None


@dataclass(frozen=True, slots=True, eq=False)
class SmoothedState(JumperState):
    """The jumper at one instant, from the model over time.

    Attributes:
        origin: O with its covariance.
        velocity: of O.
        angle_of_attack: phi minus the angle of the path, degrees; no wind assumed. None where no ski was ever measured.
        by_calibration: (11, p) derivatives of `QUANTITIES` by the uncertain parameters of the cameras
            (`CameraSystem.covariance`); rows of quantities that are None hold NaN.
    """

    origin: Vector
    velocity: Vector
    angle_of_attack: Quantity | None
    by_calibration: Floats


@dataclass(frozen=True, slots=True)
class RayTest:
    """The test of one ray (point) or one image line (ski) in the raw solution of its pulse.

    Attributes:
        pulse: of the image.
        camera: of the image.
        what: P1 to P4, right or left.
        residual_px: length of the residual, adjusted - observed.
        w: test value, standard normal where nothing is wrong; NaN where nothing controls it.
        removed: whether the ray was left out as a gross error.
    """

    pulse: PulseNumber
    camera: str
    what: str
    residual_px: float
    w: float
    removed: bool


@dataclass(frozen=True, slots=True, eq=False)
class PulseState:
    """One pulse of a jump.

    Attributes:
        pulse: its number in the recording.
        time: middle of the exposure, UTC.
        since_takeoff_s: negative before.
        phase: of the jump.
        raw: solution of this pulse alone; its speed is the central difference of O.
        smoothed: from the model over time; None where there is none.
        fates: what became of P1 to P4 and the skis; nothing in a file from before they were written.
    """

    pulse: PulseNumber
    time: UtcNs
    since_takeoff_s: float
    phase: Phase
    raw: JumperState
    smoothed: SmoothedState | None
    fates: Mapping[str, PartFate] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class TakeOff:
    """When O passed the edge.

    Attributes:
        pulse: in pulses, with fraction; whole numbers are the middles of the exposures.
        sigma_pulses: its standard deviation.
        time: UTC.
    """

    pulse: float
    sigma_pulses: float
    time: UtcNs


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether the jump can be trusted, in words.

    Attributes:
        ok: whether it can.
        message: for people.
        phases: per phase what was judged, ready for JSON (counts, shares, chi-square per degree of freedom).
        said: the same sentence by sentence, to be said in other languages: what speaks against the jump, then what was
            counted; empty: of an earlier svev, which had words only.
    """

    ok: bool
    message: str
    phases: Mapping[Phase, Mapping[str, Any]]
    said: tuple[Phrase, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Jump:
    """A measured jump.

    Attributes:
        number: counted from 1 in the recording.
        takeoff: None where the take-off was not in sight.
        verdict: on the whole jump.
        pulses: from the jumper's first to last appearance, measured or not.
        tests: of all rays, the worst first.
    """

    number: int
    takeoff: TakeOff | None
    verdict: Verdict
    pulses: tuple[PulseState, ...]
    tests: tuple[RayTest, ...]


@dataclass(frozen=True, slots=True, eq=False)
class CameraMove:
    """A camera that moved since it was oriented, or during the recording.

    Attributes:
        camera: its name.
        said: in words, with direction and size.
        rotation_deg: (3,) about the camera's own axes.
        shift_m: (3,) in the object system.
        p: probability of such a difference in a camera that did not move.
    """

    camera: str
    said: Phrase
    rotation_deg: Floats
    shift_m: Floats
    p: float

    @property
    def message(self) -> str:
        """In words, in English."""
        return self.said.text


@dataclass(frozen=True, slots=True)
class CameraOffset:
    """How much later than the others a camera shows the jumper.

    Attributes:
        offset_ms: positive: the camera shows a later state.
        sigma_ms: its standard deviation.
        said: that it does, in words; None while the camera is synchronous.
    """

    offset_ms: float
    sigma_ms: float
    said: Phrase | None

    @property
    def message(self) -> str | None:
        """That it does, in English; None while the camera is synchronous."""
        return None if self.said is None else self.said.text


@dataclass(frozen=True, slots=True, eq=False)
class OrientedImage:
    """The pose of a camera.

    Attributes:
        position: (3,) X0.
        rotation: (3, 3), columns are the camera's axes.
        sigma_position: (3,) m.
        sigma_angles: (3,) about the camera's own axes, degrees.
    """

    position: Floats
    rotation: Floats
    sigma_position: Floats
    sigma_angles: Floats


@dataclass(frozen=True, slots=True, eq=False)
class BallResult:
    """A ball.

    Attributes:
        role: in the adjustment: control, tie, check or fixed.
        xyz: (3,) m, adjusted.
        sigma: (3,) m.
        images: by camera (4,) x, y, sigma x, sigma y, px.
    """

    role: str
    xyz: Floats
    sigma: Floats
    images: Mapping[str, Floats]


@dataclass(frozen=True, slots=True, eq=False)
class OrientationResult:
    """The orientation of a recording's cameras.

    Attributes:
        images: by camera.
        balls: by name.
        moved: cameras that moved.
        messages: what a person should know, one line each.
        parameters: names of the uncertain parameters of the cameras (p of them), such as "K1.X0" or "K2.c".
        covariance: (p, p) of them.
        source: identifies the calibration: results with the same source share its errors.
        given: identifies survey and interior orientation that it was made with; empty if not known.
        given_covariance: (p, p) the part of the covariance that comes from them, which results with the same `given`
            share; None if not known.
    """

    images: Mapping[str, OrientedImage]
    balls: Mapping[str, BallResult]
    moved: tuple[CameraMove, ...]
    messages: tuple[str, ...]
    parameters: tuple[str, ...]
    covariance: Floats
    source: str
    given: str = ""
    given_covariance: Floats | None = None


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredRecording:
    """Everything that the analysis found in a recording.

    Attributes:
        recording: its name.
        session: fields of the session (athlete, bib, ...).
        rate_hz: pulses per second.
        orientation: of the cameras.
        synchrony: by camera.
        jumps: in order.
    """

    recording: str
    session: Mapping[str, str]
    rate_hz: float
    orientation: OrientationResult
    synchrony: Mapping[str, CameraOffset]
    jumps: tuple[Jump, ...]
