"""The truth of a scenario as plain data, to be written beside a log and to judge measurements by.

Units: m, s, degrees, m/s, px. Frame: origin at the take-off edge, X horizontal along the flight, Z up, Y to the left
(right-handed). Cameras and pixel coordinates follow the network file (pixel frame, Eq. A1). `height` (Z0 of the paper)
and `speed` (v) are those of O, the midpoint of P3 and P4; P3 and ski `right` belong together, P4 and `left`. `skis`
holds a point and a direction (tail to tip) of each line and its parameters by Eq. (C8), Z = alpha X + gamma and
Y = beta X + delta; `angles` are those of Fig. 6 (`simrig.world.stick_model`).
"""

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from simrig.world.jumper import FLIGHT_X_M, Jump, JumpSeries
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario
from simrig.world.stick_model import angles, ski_line

FORMAT = "svev-truth/1"
MARKERS = ("P1", "P2", "P3", "P4")

Array = NDArray[np.float64]


def truth(
    scenario: Scenario, pulses: Iterable[int], rate_hz: float, size: tuple[int, int] = (640, 480)
) -> dict[str, Any]:
    """What the scenario shows at these hill pulses; JSON-able.

    Args:
        scenario: the scenario.
        pulses: hill pulses, counted from 0.
        rate_hz: of the pulses.
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


def _pulse(jumps: JumpSeries, projections: dict[str, Projection], pulse: int, rate_hz: float) -> dict[str, Any]:
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


def _seen(projection: Projection, point: Array) -> list[float] | None:
    """Pixel coordinates of a point, None where it is outside of the image."""
    pixel = projection.pixels(point)
    in_sight = projection.distance(point) > 0 and projection.sees(pixel)
    return [float(v) for v in pixel] if in_sight else None
