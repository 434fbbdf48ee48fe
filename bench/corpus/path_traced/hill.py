"""The images of a path-traced hill: Blender's pictures behind lens, moving camera and sensor of the scenario."""

from collections.abc import Sequence
from typing import Any, Final

import cv2
import numpy as np

from bench.corpus.path_traced.optics import FINER, Optics
from bench.corpus.path_traced.pictures import Pictures
from bench.corpus.path_traced.stage import STILL, Stage
from rig.images.pixels import Stored
from rig.pulse import HillPulse
from simrig.world.figure.mass import centre_of_mass, landmarks
from simrig.world.scenario import BRIGHTEST, Scenario
from simrig.world.truth import truth

_IN_SIGHT: Final = 0.5


class PathTracedHill:
    """The scenario's cameras, balls and first jumper, rendered by Blender.

    Args:
        scenario: the scenario.
        pulses: hill pulses.
        size: of the images, width and height, px.
        rate_hz: pulses per second.

    Raises:
        BadInputError: Blender is missing, or fails.
    """

    def __init__(self, scenario: Scenario, pulses: range, size: tuple[int, int], rate_hz: float) -> None:
        self._scenario = scenario
        self._states = {s["pulse"]: s for s in truth(scenario, map(HillPulse, pulses), rate_hz, size)["pulses"]}
        self._optics = [Optics(scenario, index, size) for index in range(len(scenario.cameras))]
        self._stage = Stage(scenario, self._states, self._optics)
        self._pictures = Pictures(self._stage.told)
        self._still = [self._pictures.parts(f"{camera.name}-{STILL}")[0][2] for camera in scenario.cameras]
        self._rng = np.random.default_rng((scenario.seed, 6))

    def views(self) -> "Sequence[PathTracedView]":
        """What each camera sees."""
        return [PathTracedView(self, index) for index in range(len(self._optics))]

    def frame(self, index: int, pulse: HillPulse) -> Stored:
        """The image of a camera at a hill pulse, (rows, columns)."""
        state, settings, effects = self._states[pulse], self._scenario.cameras[index], self._scenario.image
        picture = self._still[index].copy()
        if state["jumper_present"]:
            for rows, columns, part in self._pictures.parts(f"{settings.name}-{pulse}"):
                picture[rows, columns] = part
        # A pixel of the image averages over a square, a pixel of the picture already over a smaller one.
        blur = FINER * np.sqrt(effects.blur_sigma_px**2 + (1 - 1 / FINER**2) / 12)
        blurred = cv2.GaussianBlur(picture, (0, 0), float(blur))
        x, y = np.moveaxis(self._optics[index].places(state["middle_s"][settings.name]), -1, 0).astype(np.float32)
        light = np.maximum(cv2.remap(blurred, x, y, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE), 0.0)
        grey = state["light"][settings.name] * settings.gain * BRIGHTEST * light
        shot = grey / effects.electrons_per_grey if effects.electrons_per_grey else 0.0
        noise = np.sqrt(effects.noise_sigma**2 + shot) * self._rng.normal(size=grey.shape)
        return np.asarray(np.clip(np.round(effects.black_level + grey + noise), 0, 255), np.uint8)

    def truth(self, states: dict[int, dict[str, Any]]) -> dict[int, dict[str, Any]]:
        """The truth of a log of these pictures: this body's joints, and what of the markers the pictures show.

        Args:
            states: truth of the scenario, by number in the log.
        """
        return {number: self._true(state) if state["jumper_present"] else state for number, state in states.items()}

    def _true(self, state: dict[str, Any]) -> dict[str, Any]:
        joints = self._stage.joints(state["pulse"])
        alone, together = centre_of_mass(joints, self._scenario.jumper)
        visible = {}
        for name, spots in state["images"].items():
            seen = self._pictures.seen(f"{name}-{state['pulse']}")
            visible[name] = {label: 0.0 if spot is None else seen.get(label, 0.0) for label, spot in spots.items()}
        return {
            **state,
            "landmarks": {name: place.tolist() for name, place in landmarks(joints).items()},
            "centre_of_mass": {"body": alone.tolist(), "with_equipment": together.tolist()},
            "visible": visible,
            "in_sight": {
                name: {label: share >= _IN_SIGHT for label, share in of.items()} for name, of in visible.items()
            },
        }


class PathTracedView:
    """What one camera sees of a path-traced hill."""

    def __init__(self, hill: PathTracedHill, index: int) -> None:
        self._hill, self._index = hill, index

    def render_into(self, out: Stored, pulse: HillPulse) -> None:
        """See `bench.analysis.hill_logs.View`."""
        out[...] = self._hill.frame(self._index, pulse)
