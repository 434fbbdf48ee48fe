"""The truth of a scenario as plain data: `svev demo` writes it beside a log, and tests judge measurements by it.

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
"""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from rig.arrays import Floats
from rig.pulse import HillPulse
from simrig.world.jumper import FLIGHT_X_M, Jump, JumpSeries, Pose
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario

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
    projections = {camera.name: camera.projection(*size) for camera in scenario.cameras}
    jumps = JumpSeries(scenario)
    return {
        "format": FORMAT,
        "scenario": scenario.name,
        "seed": scenario.seed,
        "rate_hz": rate_hz,
        "length_unit": "m",
        "image_frame": "pixel",
        "ski_length": scenario.jumper.ski_length_m,
        "cameras": {name: _camera(projection) for name, projection in projections.items()},
        "balls": {ball.name: {"role": ball.role, "X": list(ball.X)} for ball in scenario.balls},
        "ball_images": {
            name: {ball.name: _seen(projection, np.array(ball.X)) for ball in scenario.balls}
            for name, projection in projections.items()
        },
        "pulses": [_pulse(jumps, projections, pulse, rate_hz) for pulse in pulses],
    }


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


def _camera(projection: Projection) -> dict[str, Any]:
    nothing = dict.fromkeys(("x0", "y0", "a1", "a2", "a3", "r0", "b1", "b2", "c1", "c2"), 0.0)
    return {
        "size": [projection.width, projection.height],
        "c": projection.c,
        **nothing,
        "distortion": "projected",
        "X0": projection.X0.tolist(),
        "R": projection.R.tolist(),
    }


def _pulse(jumps: JumpSeries, projections: dict[str, Projection], pulse: HillPulse, rate_hz: float) -> dict[str, Any]:
    there = jumps.at_pulse(pulse, rate_hz)
    state = {"pulse": pulse, "time_s": pulse / rate_hz, "jumper_present": there is not None}
    return state if there is None else {**state, **_jumper(*there, projections)}


def _jumper(jump: Jump, time_s: float, projections: dict[str, Projection]) -> dict[str, Any]:
    pose = jump.pose(time_s)
    velocity = jump.velocity(time_s)
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
        "images": {
            name: {marker: _seen(p, point) for marker, point in zip(MARKERS, pose.markers, strict=True)}
            for name, p in projections.items()
        },
    }


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
