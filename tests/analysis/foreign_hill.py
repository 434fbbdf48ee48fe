"""A hill that nothing was made on (`foreign_hill.toml`), in the frame of its surveyor.

The surveyor's X axis does not point along the flight, and his origin is not the take-off edge: points of the scenario
are turned about the vertical and shifted. Heights change by a constant, angles and speeds do not change.
"""

import math
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from rig.arrays import Floats
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario, load_scenario

SCENARIO: Final = Path(__file__).with_suffix(".toml")
SIZE: Final = (1280, 720)
RATE_HZ: Final = 100.0
#: Take-off edge in the surveyor's frame, m, and direction of the flight there.
EDGE: Final = np.array((412.3, 1087.6, 655.2))
FLIGHT_DEG: Final = 143.7


@cache
def foreign() -> Scenario:
    """The scenario, in its own frame."""
    return load_scenario(SCENARIO)


def turned(directions: Floats) -> Floats:
    """Directions or velocities, (..., 3), of the scenario in the surveyor's frame."""
    return np.asarray(directions @ _turn().T)


def surveyed(points: Floats) -> Floats:
    """Points, (..., 3), of the scenario in the surveyor's frame."""
    return np.asarray(turned(points) + EDGE)


def surveyed_camera(projection: Projection) -> tuple[Floats, Floats]:
    """X0 and R of a camera in the surveyor's frame."""
    return surveyed(projection.X0), np.asarray(_turn() @ projection.R)


def survey_json(seed: int, sigma: float = 0.01) -> dict[str, Any]:
    """The survey file's object: control with errors, tie balls without coordinates, cameras as calibrated."""
    scenario, rng = foreign(), np.random.default_rng(seed)
    cameras: dict[str, Any] = {}
    for camera in scenario.cameras:
        scale = SIZE[0] / 640
        lens = camera.lens.model_dump()
        by = {"x0": scale, "y0": scale, "r0": scale, "a1": scale**-2, "a2": scale**-4, "a3": scale**-6}
        by |= {"b1": 1 / scale, "b2": 1 / scale}
        scaled = {key: value * by.get(key, 1.0) for key, value in lens.items()}
        cameras[camera.name] = {"size": list(SIZE), "c": camera.c * scale, **scaled, "distortion": "projected"}
    points: dict[str, Any] = {}
    for ball in scenario.balls:
        if ball.role == "control":
            place = surveyed(np.array(ball.X)) + rng.normal(0, sigma, 3)
            points[ball.name] = {"role": "control", "X": place.tolist(), "sigma": [sigma] * 3}
        else:
            points[ball.name] = {"role": "tie", "X": None}
    return {
        "format": "svev-network/1", "length_unit": "m", "image_frame": "pixel", "cameras": cameras, "points": points,
    }  # fmt: skip


def _turn() -> Floats:
    angle = math.radians(FLIGHT_DEG)
    return np.array(
        ((math.cos(angle), -math.sin(angle), 0.0), (math.sin(angle), math.cos(angle), 0.0), (0.0, 0.0, 1.0))
    )
