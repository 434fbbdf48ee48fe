"""The truth of a scenario as plain data: it stands beside every log of a simulated rig; tests judge measurements by it.

Units: m, s, degrees, m/s, px. Frame: origin at the take-off edge, X horizontal along the flight, Z up, Y to the left
(right-handed). Cameras and pixel coordinates follow the network file (pixel frame, Eq. A1). `height` (Z0 of the paper)
and `speed` (v) are those of O, the midpoint of P3 and P4. P3 belongs to the ski `right`, P4 to `left`. `skis` holds a
point and a direction (tail to tip) of each ski line, and its parameters by Eq. (C8).

`angles` are those of Fig. 6, degrees, where X' is the mean direction of the skis (tail to tip):

- alpha: between X' and the legs O-P2;
- beta: at the hip, between P2-O and P2-P1; 180 would be a straight body;
- gamma: between the two skis, the opening of the V;
- dphi: slope of the right ski minus slope of the left one;
- phi: slope of X' above the horizontal.

Of a pulse: `time_s` is the scene time at which it fires; `state_s` is the middle of the exposure that it starts (of
several exposure times the mean), at which points, skis, angles, height, speed, landmarks and centre of mass are true.
`images` are true at the middle of each camera's own exposure, `middle_s`, with its distortion and in its pose of that
moment, for moving cameras one of `poses`. `visible` says which share of each marker's disc is in sight, `in_sight`
whether that is half of it or more; `light` is the share of the full light. `takeoff_s` is the scene time at which O
passes the edge, `takeoff_pulse` the same in pulses.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rig.arrays import Floats
from rig.pulse import HillPulse
from simrig.world.conditions import surroundings
from simrig.world.conditions.camera_motion import CameraMotion
from simrig.world.conditions.daylight import Daylight
from simrig.world.figure import body
from simrig.world.figure.mass import centre_of_mass, landmarks
from simrig.world.figure.sight import IN_SIGHT, inside, visible_shares
from simrig.world.jumper import FLIGHT_X_M, Jump, JumpSeries, Pose
from simrig.world.projection import Lens, Projection, Window
from simrig.world.scenario import Ball, Scenario, SceneCamera

FORMAT = "svev-truth/1"
MARKERS = ("P1", "P2", "P3", "P4")


@dataclass(frozen=True, slots=True)
class Angles:
    """Angles of Fig. 6, degrees."""

    alpha: float
    beta: float
    gamma: float
    dphi: float
    phi: float


@dataclass(frozen=True, slots=True)
class SkiLine:
    """A ski line by Eq. (C8): Z = alpha X + gamma, Y = beta X + delta."""

    alpha: float
    beta: float
    gamma: float
    delta: float


def truth(
    scenario: Scenario, pulses: Iterable[HillPulse], rate_hz: float, size: tuple[int, int] = (640, 480)
) -> dict[str, Any]:
    """What the scenario shows at these hill pulses, ready for JSON.

    Args:
        scenario: the scenario.
        pulses: hill pulses, counted from 0.
        rate_hz: pulses per second.
        size: width and height of the images, px.
    """
    whole = Window(size, 0, 0, *size)
    known = Truth(scenario, rate_hz, {camera.name: whole for camera in scenario.cameras})
    return {**known.setting(), "pulses": [known.state(pulse) for pulse in pulses]}


class Truth:
    """The truth of a scenario, piece by piece.

    Args:
        scenario: the scenario.
        rate_hz: pulses per second.
        windows: what is recorded of each camera's images, by name; cameras that are not named do not appear.
    """

    def __init__(self, scenario: Scenario, rate_hz: float, windows: Mapping[str, Window]) -> None:
        self._scenario, self._rate_hz = scenario, rate_hz
        self._seers = {
            camera.name: _Seer(scenario, index, windows[camera.name])
            for index, camera in enumerate(scenario.cameras)
            if camera.name in windows
        }
        self._jumps = JumpSeries(scenario)

    def setting(self) -> dict[str, Any]:
        """All members but `pulses`."""
        return _setting(self._scenario, self._seers, self._rate_hz)

    def state(self, pulse: HillPulse) -> dict[str, Any]:
        """The member of `pulses` for one hill pulse, counted from 0."""
        return _pulse(self._scenario, self._jumps, self._seers, pulse, self._rate_hz)


def _setting(scenario: Scenario, seers: "Mapping[str, _Seer]", rate_hz: float) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "scenario": scenario.name,
        "seed": scenario.seed,
        "rate_hz": rate_hz,
        "length_unit": "m",
        "image_frame": "pixel",
        "ski_length": scenario.jumper.ski_length_m,
        "cameras": {name: _camera(seer.settings, seer.projection) for name, seer in seers.items()},
        "balls": {
            ball.name: {"role": ball.role, "X": list(ball.X), "covered": ball.covered, "gone": ball.gone}
            for ball in scenario.balls
        },
        "ball_images": {
            name: {ball.name: _seen(seer.projection, np.array(ball.X)) for ball in scenario.balls}
            for name, seer in seers.items()
        },
        "ball_visible": {
            name: {ball.name: _ball_share(scenario, ball, seer.projection) for ball in scenario.balls}
            for name, seer in seers.items()
        },
    }


class _Seer:
    """One camera of the scenario, at any time."""

    def __init__(self, scenario: Scenario, index: int, window: Window) -> None:
        self.settings = scenario.cameras[index]
        self.projection = self.settings.projection(*window.full).windowed(window)
        self._scenario = scenario
        self._people = surroundings.walkers(scenario)
        self._motion = CameraMotion(scenario, index)
        self._daylight = Daylight(scenario.light, scenario.seed)

    def moment(self, pulse: HillPulse, rate_hz: float) -> dict[str, Any]:
        """What holds for the camera at a pulse, whoever jumps."""
        middle_s = self.settings.middle_s(pulse, rate_hz)
        now = {"middle_s": middle_s, "light": self._daylight.at(middle_s, self.settings.exposure_us / 1e6)}
        if self._motion.still:
            return now
        moved = self._motion.at(self.projection, middle_s)
        return {**now, "X0": moved.X0.tolist(), "R": moved.R.tolist()}

    def see(self, jump: Jump, pulse: HillPulse, rate_hz: float) -> tuple[dict[str, Any], dict[str, float]]:
        """Pixel coordinates of the markers, and the share of each that is in sight."""
        scene_s = self.settings.middle_s(pulse, rate_hz)
        projection = self._motion.at(self.projection, scene_s)
        pose = jump.pose(scene_s - jump.takeoff_s)
        distance = float(projection.distance(pose.origin))
        fronts = surroundings.fronts(self._scenario, self._people, projection, scene_s, distance)
        shares = visible_shares(self._scenario, pose, projection, jump.number, fronts)
        spots = {marker: _seen(projection, point) for marker, point in zip(MARKERS, pose.markers, strict=True)}
        return spots, dict(zip(MARKERS, shares, strict=True))


def angles(pose: Pose) -> Angles:
    """The angles of a pose."""
    helmet, hip = pose.markers[0], pose.markers[1]
    right, left = pose.skis
    forward = pose.axes[0]
    return Angles(
        alpha=_between(forward, hip - pose.origin),
        beta=_between(pose.origin - hip, helmet - hip),
        gamma=_between(right, left),
        dphi=_slope(right) - _slope(left),
        phi=_slope(forward),
    )


def ski_line(point: Floats, direction: Floats) -> SkiLine:
    """The line through `point` along `direction`, both of shape (3,); it must not be parallel to the YZ plane."""
    alpha, beta = float(direction[2] / direction[0]), float(direction[1] / direction[0])
    return SkiLine(alpha, beta, float(point[2] - alpha * point[0]), float(point[1] - beta * point[0]))


def _camera(settings: SceneCamera, projection: Projection) -> dict[str, Any]:
    lens = projection.lens or Lens(*[0.0] * 10)
    return {
        "size": [projection.width, projection.height],
        "c": projection.c,
        **asdict(lens),
        "distortion": "projected",
        "X0": projection.X0.tolist(),
        "R": projection.R.tolist(),
        "exposure_us": settings.exposure_us,
        "late_ms": settings.late_ms,
    }


def _pulse(
    scenario: Scenario, jumps: JumpSeries, seers: Mapping[str, _Seer], pulse: HillPulse, rate_hz: float
) -> dict[str, Any]:
    time_s = pulse / rate_hz
    state_s = time_s + float(np.mean([seer.settings.exposure_us for seer in seers.values()])) / 2e6
    moments = {name: seer.moment(pulse, rate_hz) for name, seer in seers.items()}
    there = jumps.at(state_s)
    state = {
        "pulse": pulse,
        "time_s": time_s,
        "state_s": state_s,
        "middle_s": {name: moment.pop("middle_s") for name, moment in moments.items()},
        "light": {name: moment.pop("light") for name, moment in moments.items()},
        "poses": {name: moment for name, moment in moments.items() if moment},
        "jumper_present": there is not None,
    }
    if there is None:
        return state
    jump, since_s = there
    seen = {name: seer.see(jump, pulse, rate_hz) for name, seer in seers.items()}
    return {
        **state,
        **_jumper(scenario, jump, since_s),
        "takeoff_s": jump.takeoff_s,
        "takeoff_pulse": jump.takeoff_s * rate_hz,
        "images": {name: spots for name, (spots, _) in seen.items()},
        "visible": {name: shares for name, (_, shares) in seen.items()},
        "in_sight": {
            name: {marker: share >= IN_SIGHT for marker, share in shares.items()}
            for name, (_, shares) in seen.items()
        },
    }  # fmt: skip


def _jumper(scenario: Scenario, jump: Jump, time_s: float) -> dict[str, Any]:
    pose = jump.pose(time_s)
    velocity = jump.velocity(time_s)
    joints = body.joints(pose, scenario.jumper.ski_length_m / 2)
    alone, together = centre_of_mass(joints, scenario.jumper)
    skis = zip(("right", "left"), pose.markers[2:], pose.skis, strict=True)
    return {
        "jump": jump.number,
        "since_takeoff_s": time_s,
        "in_flight": bool(FLIGHT_X_M[0] <= pose.origin[0] <= FLIGHT_X_M[1]),
        "points": {name: point.tolist() for name, point in zip(MARKERS, pose.markers, strict=True)},
        "skis": {
            side: {"point": point.tolist(), "direction": along.tolist(), **asdict(ski_line(point, along))}
            for side, point, along in skis
        },
        "angles": asdict(angles(pose)),
        "origin": pose.origin.tolist(),
        "height": float(pose.origin[2]),
        "velocity": velocity.tolist(),
        "speed": float(np.linalg.norm(velocity)),
        "landmarks": {name: place.tolist() for name, place in landmarks(joints).items()},
        "centre_of_mass": {"body": alone.tolist(), "with_equipment": together.tolist()},
    }


def _ball_share(scenario: Scenario, ball: Ball, projection: Projection) -> float:
    """Share of a ball's height that is in sight of a camera as it was set up."""
    spot = projection.pixels(ball.X)
    hidden = any(bool(inside(shape, spot[None])[0]) for shape in surroundings.tower_outlines(scenario, projection))
    if ball.gone or hidden or _seen(projection, np.array(ball.X)) is None:
        return 0.0
    return 1.0 - ball.covered


def _seen(projection: Projection, point: Floats) -> list[float] | None:
    """Pixel coordinates of a point; None if it is outside the image."""
    pixel = projection.pixels(point)
    in_sight = projection.distance(point) > 0 and projection.sees(pixel)
    return [float(v) for v in pixel] if in_sight else None


def _between(a: Floats, b: Floats) -> float:
    """Angle between two directions, degrees."""
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)))


def _slope(direction: Floats) -> float:
    """Slope of a direction above the horizontal, degrees."""
    return math.degrees(math.atan2(direction[2], math.hypot(direction[0], direction[1])))
