"""The scenario: one seeded TOML file that decides everything that the simulated hill shows and does.

Frame: origin at the take-off edge, X horizontal along the flight, Z up, Y to the left (right-handed); m, s, degrees.
Times of the jumper count from the moment in which the middle of the skis passes the edge.
"""

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, model_validator

from rig.arrays import Floats
from rig.errors import BadInputError
from rig.images.viewing import look_at
from rig.pulse import HillPulse
from rig.settings.file_kinds import FileKind, refuse_other
from rig.settings.strict_toml import read_toml, validate
from simrig.world.board import HeldBoard
from simrig.world.conditions.effects import (
    FiniteModel,
    LensErrors,
    Light,
    MissingMarker,
    Move,
    Surroundings,
    Vector,
    Weather,
)
from simrig.world.faults import Fault
from simrig.world.keyframes import Keyframes
from simrig.world.projection import Lens, Projection

REFERENCE_WIDTH = 640  #: px; principal distances in a scenario belong to images of this width
#: Radiance of the brightest things (markers, balls, skis): grey values at gain 1, above the black level.
BRIGHTEST = 225.0


class Hill(FiniteModel):
    """Profile of the hill: take-off table, knoll, landing slope. The defaults are those of a K120 hill.

    The table is straight. The knoll is the cubic of the FIS standards for the construction of jumping hills. It begins
    below the edge with its own slope and meets the P point, where the landing slope is steepest, in height and slope.
    """

    table_angle_deg: float = Field(11.0, ge=0, le=20, description="slope of the take-off table")
    table_height_m: float = Field(3.0, gt=0, description="from the knoll's foot up to the edge")
    table_width_m: float = Field(3.0, gt=0)
    knoll_angle_deg: float = Field(6.0, ge=0, le=30, description="slope of the knoll below the edge")
    knoll_width_m: float = Field(12.0, gt=0, description="width of the prepared snow")
    p_x_m: float = Field(87.5, gt=20, description="horizontal distance from the edge to the P point")
    p_z_m: float = Field(-48.0, lt=0, description="height of the P point")
    p_angle_deg: float = Field(37.0, gt=0, le=45, description="slope at the P point")

    def table(self, x: ArrayLike) -> Floats:
        """Height of the table's surface above the edge, m, for x <= 0."""
        return np.asarray(x, float) * -math.tan(math.radians(self.table_angle_deg))

    def ground(self, x: ArrayLike) -> Floats:
        """Height of the snow on knoll and landing slope, m; level under the table, straight beyond the P point."""
        x = np.asarray(x, float)
        foot, steep = math.tan(math.radians(self.knoll_angle_deg)), math.tan(math.radians(self.p_angle_deg))
        u = -self.p_z_m - self.table_height_m - self.p_x_m * foot
        v = self.p_x_m * (steep - foot)
        part = np.clip(x, 0.0, self.p_x_m) / self.p_x_m
        knoll = -self.table_height_m - foot * self.p_x_m * part - (3 * u - v) * part**2 + (2 * u - v) * part**3
        height: Floats = knoll - steep * np.maximum(x - self.p_x_m, 0.0)
        return height

    def snow(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Height of the snow at any places, m: beside the knoll it rises to the left and falls gently to the right."""
        y = np.asarray(y, float)
        beside = np.maximum(0.0, np.abs(y) - self.knoll_width_m / 2)
        height: Floats = self.ground(x) + np.where(y > 0, 0.12, -0.05) * beside
        return height


class Jumper(FiniteModel):
    """The jumper: flight by gravity, lift and drag, posture by keyframes [time_s, value]."""

    takeoff_speed_m_s: float = Field(26.0, gt=5, le=40)
    takeoff_angle_deg: float = Field(-5.8, ge=-20, le=20, description="direction of flight at the edge, up positive")
    mass_kg: float = Field(68.0, gt=20, le=200, description="with equipment")
    air_density_kg_m3: float = Field(1.25, ge=0, le=2)
    drag_area_m2: Keyframes = ((0.0, 0.32), (0.3, 0.46), (1.0, 0.58))
    lift_area_m2: Keyframes = ((0.0, 0.06), (0.3, 0.34), (1.0, 0.66))
    ski_length_m: float = Field(2.63, gt=0.5, le=4)
    ski_slope_deg: Keyframes = ((0.0, -11.0), (0.25, -2.0), (0.55, 7.0), (0.9, 11.0))
    ski_slope_difference_deg: Keyframes = ((0.0, 0.0), (0.4, 1.5), (0.9, 0.6))
    ski_opening_deg: Keyframes = ((0.02, 0.0), (0.3, 11.0), (0.9, 29.0))
    ski_gap_m: Keyframes = ((0.0, 0.34), (0.5, 0.5), (0.9, 0.6))
    leg_length_m: Keyframes = ((-0.35, 0.5), (0.04, 0.86), (0.5, 0.84))
    leg_angle_deg: Keyframes = ((-0.35, 96.0), (0.0, 76.0), (0.25, 58.0), (0.55, 44.0), (0.9, 37.0))
    torso_length_m: float = Field(0.72, gt=0.2, le=1.5, description="from hip to helmet marker")
    torso_angle_deg: Keyframes = ((-0.35, 12.0), (0.0, 41.0), (0.25, 31.0), (0.55, 22.0), (0.9, 19.0))
    marker_radius_m: float = Field(0.05, gt=0.01, le=0.1)
    marker: float = Field(BRIGHTEST, ge=0, le=BRIGHTEST, description="radiance of the markers")
    patch: float = Field(34.0, ge=0, le=BRIGHTEST, description="radiance of helmet and suit around the markers")
    suit: float = Field(44.0, ge=0, le=BRIGHTEST, description="radiance of the suit where no sky lights it")
    skis: float = Field(222.0, ge=0, le=BRIGHTEST, description="radiance of the skis")
    occlusion: bool = Field(False, description="body and skis hide markers behind them; else no marker is ever hidden")
    missing_markers: tuple[MissingMarker, ...] = ()
    ski_mass_kg: float = Field(3.6, ge=0, le=10, description="one ski with its binding")
    boot_mass_kg: float = Field(1.4, ge=0, le=5, description="one boot")

    def worn(self, jump: int) -> tuple[bool, bool, bool, bool]:
        """Which of the markers P1..P4 the jumper of jump number `jump` wears."""
        missing = {m.marker for m in self.missing_markers if m.jump in (None, jump)}
        return "P1" not in missing, "P2" not in missing, "P3" not in missing, "P4" not in missing


class Variation(FiniteModel):
    """Standard deviations by which the jumps of one scenario differ. All zero: every jump is the same."""

    speed_m_s: float = Field(0.2, ge=0, le=2)
    takeoff_angle_deg: float = Field(0.25, ge=0, le=3)
    lift: float = Field(0.05, ge=0, le=0.3, description="fraction of the lift and drag areas")
    posture_deg: float = Field(1.0, ge=0, le=5, description="slope, leg and torso angles after take-off")
    side_m_s: float = Field(0.08, ge=0, le=1, description="sideways speed")
    yaw_deg: float = Field(0.8, ge=0, le=5)


class ImageEffects(FiniteModel):
    """How radiance becomes grey values: grey = black_level + gain * radiance + noise."""

    black_level: float = Field(8.0, ge=0, le=100)
    noise_sigma: float = Field(2.5, ge=0, le=20, description="grey values")
    blur_sigma_px: float = Field(0.55, ge=0.4, le=3, description="of the lens")
    snow_flakes: int = Field(60, ge=0, le=5000, description="in the image at any time")
    electrons_per_grey: float = Field(
        0.0, ge=0, le=1000, description="electrons that make one grey value; their number scatters; 0: no such noise"
    )
    background_scale: float = Field(1.0, ge=0, le=2, description="radiance of the hill is multiplied by it ...")
    background_offset: float = Field(0.0, ge=-225, le=225, description="... and this is added; balls stay as they are")

    def noise_at(self, grey: float) -> float:
        """Standard deviation of the noise where the image has the grey value `grey` without noise."""
        electrons = max(0.0, grey - self.black_level) * self.electrons_per_grey
        return math.hypot(self.noise_sigma, math.sqrt(electrons) / (self.electrons_per_grey or 1.0))


class SceneCamera(FiniteModel):
    """One camera of the hill: its place, its optics, the error of its clock."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,15}$")
    c: float = Field(gt=100, description="principal distance in px of a 640 px wide image")
    X0: Vector = Field(description="projection centre")
    look_at: Vector | None = Field(None, description="point on the optical axis")
    roll_deg: float = Field(0.0, ge=-180, le=180, description="clockwise as seen from behind the camera")
    R: tuple[Vector, Vector, Vector] | None = Field(None, description="rotation row by row, instead of look_at")
    gain: float = Field(1.0, gt=0.05, le=2)
    offset_s: float = Field(0.0, description="device clock minus host clock when both start")
    drift_ppm: float = Field(0.0, ge=-1000, le=1000, description="by how much the device clock runs fast")
    exposure_jitter_us: float = Field(
        1.0, ge=0, le=5000, description="scatter of the exposure's device time about the pulse; the image is not moved"
    )
    exposure_us: float = Field(
        0.0, ge=0, le=100_000, description="the jumper is blurred over so long a time, which begins at the pulse"
    )
    late_ms: float = Field(
        0.0, ge=0, le=1000, description="the image shows the scene so much later than the camera says (a fault)"
    )
    lens: LensErrors = LensErrors()
    shake_deg: float = Field(0.0, ge=0, le=1, description="root mean square of the shake about r1 and r2")
    moves: tuple[Move, ...] = Field((), max_length=20, description="drift and knocks")

    @model_validator(mode="after")
    def _one_orientation(self) -> "SceneCamera":
        if (self.look_at is None) == (self.R is None):
            raise ValueError(f"camera {self.name} needs either look_at or R: give one of them")
        if self.R is not None:
            R = np.array(self.R)  # noqa: N806
            if not np.allclose(R.T @ R, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0:
                raise ValueError(f"camera {self.name}: R is no rotation: give orthonormal columns r1, r2, r3")
            if self.roll_deg:
                raise ValueError(f"camera {self.name}: R holds the roll already: remove roll_deg")
        elif self.look_at is not None and np.hypot(*(np.array(self.X0) - self.look_at)[:2]) < 1e-3:
            raise ValueError(f"camera {self.name} looks straight up or down: move X0 or look_at sideways, or give R")
        return self

    def rotation(self) -> Floats:
        """R, shape (3, 3), columns r1, r2, r3 of Eq. (A1)."""
        if self.look_at is None:
            return np.array(self.R, float)
        return look_at(self.X0, self.look_at, self.roll_deg)

    def projection(self, width: int, height: int) -> Projection:
        """The camera with an image of `width` x `height` px: the field of view is the same at every width."""
        scale = width / REFERENCE_WIDTH
        lens = Lens(**self.lens.model_dump()).scaled(scale) if self.lens != LensErrors() else None
        return Projection(np.array(self.X0, float), self.rotation(), self.c * scale, width, height, lens)

    def middle_s(self, pulse: HillPulse, rate_hz: float) -> float:
        """Scene time of the middle of the exposure that shows hill pulse `pulse`."""
        return pulse / rate_hz + self.exposure_us / 2e6 + self.late_ms / 1e3


class Ball(FiniteModel):
    """One signalised static point: a reflective handball on a black plate."""

    name: str = Field(min_length=1, max_length=16)
    role: Literal["control", "tie"] = Field(description="control: surveyed reference ball; tie: unknown")
    X: Vector
    covered: float = Field(0.0, ge=0, le=1, description="share of its height that snow hides, from below")
    gone: bool = Field(False, description="it fell: the survey knows it, but there is nothing to see")


class Scenario(FiniteModel):
    """One simulated session on the hill."""

    name: str = Field(min_length=1, max_length=80)
    seed: int = Field(ge=0, le=2**32 - 1)
    jump_every_s: float = Field(4.0, ge=2.5, description="from one jump to the next")
    first_takeoff_s: float = Field(1.0, ge=0, description="scene time at which the first jumper leaves the edge")
    stamp: bool = Field(True, description="write camera and hill pulse into the image (`simrig.images.stamp`)")
    pauses: tuple[tuple[int, int], ...] = Field((), description="hill pulses [from, to) that are not fired")
    hill: Hill = Hill()
    jumper: Jumper = Jumper()
    variation: Variation = Variation()
    image: ImageEffects = ImageEffects()
    light: Light = Light()
    weather: Weather = Weather()
    surroundings: Surroundings = Surroundings()
    cameras: Annotated[tuple[SceneCamera, ...], Field(min_length=1, max_length=8)]
    balls: tuple[Ball, ...] = ()
    ball_radius_m: float = Field(0.095, gt=0.02, le=0.3)
    faults: tuple[Fault, ...] = ()
    board: HeldBoard | None = None

    @model_validator(mode="after")
    def _parts_fit_together(self) -> "Scenario":
        for what, names in (("camera", [c.name for c in self.cameras]), ("ball", [b.name for b in self.balls])):
            if twice := sorted({name for name in names if names.count(name) > 1}):
                raise ValueError(f"{what} name {', '.join(twice)} is used twice: give each {what} its own name")
        known = [camera.name for camera in self.cameras]
        for fault in self.faults:
            if fault.camera not in known:
                raise ValueError(f'fault of camera "{fault.camera}": no such camera; name one of {", ".join(known)}')
        if self.board is not None and self.board.before not in known:
            raise ValueError(f'board.before = "{self.board.before}": no such camera; name one of {", ".join(known)}')
        for first, end in self.pauses:
            if not 0 <= first < end:
                raise ValueError(f"pauses: [{first}, {end}] is empty: give a first pulse of at least 0 and a later end")
        for camera in self.cameras:
            brightest = self.image.black_level + camera.gain * BRIGHTEST
            top = brightest + 4 * self.image.noise_at(brightest)
            if top > 255:
                raise ValueError(
                    f"camera {camera.name} saturates at grey value {top:.0f}: lower gain, black_level or noise_sigma"
                )
        return self

    def camera_index(self, name: str) -> int:
        """Index of the camera called `name`, 0 for the leftmost.

        Raises:
            BadInputError: the scenario has no such camera.
        """
        names = [camera.name for camera in self.cameras]
        if name not in names:
            raise BadInputError(f'scenario "{self.name}" has no camera "{name}"; name one of {", ".join(names)}')
        return names.index(name)

    def faults_of(self, name: str) -> tuple[Fault, ...]:
        """The planned faults of the camera called `name`."""
        return tuple(fault for fault in self.faults if fault.camera == name)


def load_scenario(path: Path) -> Scenario:
    """Read and check a scenario file.

    The key `base` names another scenario file, relative to this one, for everything that this file leaves out; that
    one may have a base too. Tables are merged key by key; a list of this file replaces that of the base.

    Raises:
        BadInputError: the file is missing or no valid scenario; the message names file, key and remedy.
    """
    return validate(Scenario, _content(path, ()), path)


def _content(path: Path, above: tuple[Path, ...]) -> dict[str, Any]:
    """The keys of a scenario file and of its bases; `above` are the files that lead to it."""
    own = read_toml(path, kind="scenario")
    refuse_other(own, FileKind.SCENARIO, path)
    board = own.get("board")
    if isinstance(board, dict) and isinstance(board.get("pattern"), str):
        board["pattern"] = str((path.parent / board["pattern"]).resolve())
    base = own.pop("base", None)
    if base is None:
        return own
    if not isinstance(base, str):
        raise BadInputError(f'{path}: key "base" = {base!r}: give the name of a scenario file')
    leading = (*above, path.resolve())
    below = path.parent / base
    if below.resolve() in leading:
        names = " -> ".join(file.name for file in (*leading, below))
        raise BadInputError(
            f'{path}: its base leads back to "{base}" ({names}): remove the key "base" from one of them'
        )
    return _merged(_content(below, leading), own)


def _merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    both = [key for key, value in above.items() if isinstance(value, dict) and isinstance(below.get(key), dict)]
    return {**below, **above, **{key: {**below[key], **above[key]} for key in both}}
