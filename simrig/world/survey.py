"""The survey of the simulated hill as a surveyor would hand it over: balls with errors, interior orientations."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from simrig.world.projection import Window
from simrig.world.scenario import Scenario

SIGMA_M = 0.012  #: of each surveyed coordinate (the paper's estimate)
_PARAMETERS = ("x0", "y0", "a1", "a2", "a3", "r0", "b1", "b2", "c1", "c2")
_DIGITS = 4  # of coordinates, m


def survey(scenario: Scenario, size: tuple[int, int] = (640, 480), sigma: float = SIGMA_M) -> dict[str, Any]:
    """The survey as the object of a `svev-network/1` file; the same scenario gives the same errors.

    Args:
        scenario: the hill. Balls that fell down since are in the survey like all others.
        size: width and height of the images, px.
        sigma: of each coordinate, m.
    """
    whole = Window(size, 0, 0, *size)
    return windowed_survey(scenario, {camera.name: whole for camera in scenario.cameras}, sigma)


def windowed_survey(scenario: Scenario, windows: Mapping[str, Window], sigma: float = SIGMA_M) -> dict[str, Any]:
    """As `survey`, for cameras of which a part of the image is recorded.

    Args:
        scenario: the hill.
        windows: what is recorded of each camera's images, by name; cameras that are not named do not appear.
        sigma: of each coordinate, m.
    """
    rng = np.random.default_rng((scenario.seed, len(scenario.balls)))
    points: dict[str, Any] = {}
    for ball in scenario.balls:
        errors = rng.normal(0.0, sigma, 3)
        if ball.role == "control":
            surveyed = [round(float(x), _DIGITS) for x in np.array(ball.X) + errors]
            points[ball.name] = {"role": "control", "X": surveyed, "sigma": [sigma] * 3}
    cameras = {}
    for camera in scenario.cameras:
        if (window := windows.get(camera.name)) is None:
            continue
        projection = camera.projection(*window.full).windowed(window)
        lens = {} if projection.lens is None else {name: getattr(projection.lens, name) for name in _PARAMETERS}
        cameras[camera.name] = {
            "size": [window.width, window.height],
            "c": projection.c,
            **lens,
            "distortion": "projected",
        }
    return {
        "format": "svev-network/1",
        "length_unit": "m",
        "ball_radius_m": scenario.ball_radius_m,
        "image_frame": "pixel",
        "cameras": cameras,
        "points": points,
    }
