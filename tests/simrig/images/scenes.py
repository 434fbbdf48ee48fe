"""Scenarios and images for the tests of single effects."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.pulse import HillPulse
from simrig.images.view import CameraView
from simrig.world.scenario import Scenario

RATE_HZ = 37.3
SIZE = (640, 480)


def with_keys(scenario: Scenario, **tables: Any) -> Scenario:
    """The scenario with some keys replaced; a dict replaces keys of a table, `cameras` those of every camera."""
    content = scenario.model_dump()
    for key, value in tables.items():
        if key == "cameras":
            content[key] = [{**camera, **value} for camera in content[key]]
        elif isinstance(value, dict):
            content[key] = {**content[key], **value}
        else:
            content[key] = value
    return Scenario.model_validate(content)


def render(
    scenario: Scenario, camera: int, pulse: int, size: tuple[int, int] = SIZE, rate_hz: float = RATE_HZ
) -> NDArray[np.uint8]:
    """The image of one pulse, without its last line, which may hold a stamp."""
    return Renderer(scenario, camera, size, rate_hz)(pulse)


class Renderer:
    """Gives the images of one camera, without their last line."""

    def __init__(
        self, scenario: Scenario, camera: int = 0, size: tuple[int, int] = SIZE, rate_hz: float = RATE_HZ
    ) -> None:
        self._view, self._shape = CameraView(scenario, camera, *size, rate_hz), size[::-1]

    def __call__(self, pulse: int) -> NDArray[np.uint8]:
        out = np.zeros(self._shape, np.uint8)
        self._view.render_into(out, HillPulse(pulse))
        return out[:-1]
