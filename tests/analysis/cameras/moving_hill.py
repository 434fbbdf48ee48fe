"""The simulated hill filmed by cameras that move: frames, static images, and the true poses of each frame."""

from collections.abc import Collection, Iterator
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.cameras.frames import Frames
from analysis.cameras.oriented_scene import OrientedScene, scene_of_survey
from analysis.scene.orientation import orient_images
from analysis.scene.static_image import StaticImage, static_image
from photogrammetry.geometry.rotation import vector_from_rotation
from rig.arrays import Floats
from rig.pulse import HillPulse, PulseNumber
from simrig.images.view import CameraView
from simrig.world.conditions.camera_motion import CameraMotion
from simrig.world.scenario import Scenario
from tests.analysis.scene.hill import RATE_HZ, SIZE, survey_json, survey_of, training
from tests.support.kept import kept_object


class Film:
    """Frames of a scenario in memory, as a log has them."""

    def __init__(self, scenario: Scenario, pulses: int, first: int = 15) -> None:
        self.scenario = scenario
        self.pulses = tuple(PulseNumber(p) for p in range(first, first + pulses))
        self._frames: dict[PulseNumber, dict[str, NDArray[np.uint8]]] = {p: {} for p in self.pulses}
        for index, camera in enumerate(scenario.cameras):
            view = CameraView(scenario, index, *SIZE, RATE_HZ)
            for pulse in self.pulses:
                out = np.empty(SIZE[::-1], np.uint8)
                view.render_into(out, HillPulse(pulse))
                self._frames[pulse][camera.name] = out

    def frames(self, pulses: Collection[int]) -> Iterator[tuple[PulseNumber, Frames]]:
        """As `analysis.cameras.frames.FrameSource`."""
        for pulse in self.pulses:
            if pulse in pulses:
                yield pulse, self._frames[pulse]

    def static(self, frames: int = 15, pulses: range | None = None) -> dict[str, StaticImage]:
        """The static images, of some pulses if not of all."""
        there = self.pulses if pulses is None else [pulse for pulse in self.pulses if pulse in pulses]
        chosen = [there[i] for i in np.rint(np.linspace(0, len(there) - 1, frames)).astype(int)]
        return {
            camera.name: static_image(camera.name, [self._frames[p][camera.name] for p in chosen])
            for camera in self.scenario.cameras
        }

    def scene(self) -> OrientedScene:
        """Oriented from the static images."""
        return scene_of_survey(orient_images(self.static(), survey_of(survey_json(training(), 1))))

    def true_turns(self, camera: str) -> Floats:
        """(n, 3) turns of a camera in all frames, against its set-up, rad."""
        index = self.scenario.camera_index(camera)
        settings = self.scenario.cameras[index]
        set_up, motion = settings.projection(*SIZE), CameraMotion(self.scenario, index)
        poses = [motion.at(set_up, settings.middle_s(HillPulse(p), RATE_HZ)) for p in self.pulses]
        return np.array([vector_from_rotation(set_up.R.T @ pose.R) for pose in poses])


def moving(camera: str, **changes: Any) -> Scenario:
    """The training hill with a camera that has other settings."""
    scenario = training()
    data = [c.model_dump() | (changes if c.name == camera else {}) for c in scenario.cameras]
    return scenario.model_validate(scenario.model_dump() | {"cameras": data})


@cache
def shaken_film() -> Film:
    """K2 shakes in the wind; the others stand still."""
    return Film(moving("K2", shake_deg=0.012), 70)


@cache
def shaken_scene() -> OrientedScene:
    """The scene of `shaken_film`."""
    found: OrientedScene = kept_object("shaken-scene", lambda: shaken_film().scene())
    return found
