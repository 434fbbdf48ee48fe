"""Images of a hill to which noise is added anew: rendered once, so that one jump can be filmed many times cheaply."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from rig.images.pixels import Stored
from rig.pulse import HillPulse
from simrig.images.sensor import Sensor
from simrig.images.view import CameraView
from simrig.world.scenario import Scenario

_BITS = 16  #: of the images without noise: their rounding is 1/256 of a grey value
_SCALE = np.float32(2.0 ** (8 - _BITS))


class SameImages:
    """The images of all cameras without noise.

    Args:
        scenario: the hill.
        pulses: hill pulses that are rendered.
        size: width and height of the images, px.
        rate_hz: pulses per second.
    """

    def __init__(self, scenario: Scenario, pulses: Iterable[int], size: tuple[int, int], rate_hz: float) -> None:
        self._effects, self._shape = scenario.image, size[::-1]
        noiseless = scenario.image.model_copy(update={"noise_sigma": 0.0, "electrons_per_grey": 0.0})
        clean = scenario.model_copy(update={"image": noiseless})
        pulses = tuple(pulses)
        self._images: list[dict[int, NDArray[np.uint16]]] = []
        for camera in range(len(scenario.cameras)):
            view = CameraView(clean, camera, *size, rate_hz, _BITS)
            self._images.append({pulse: np.empty(self._shape, np.uint16) for pulse in pulses})
            for pulse, image in self._images[-1].items():
                view.render_into(image, HillPulse(pulse))

    def noisy(self, seed: int) -> list["NoisyView"]:
        """What each camera sees with noise of its own."""
        return [
            NoisyView(images, Sensor(self._effects, seed, camera, self._shape))
            for camera, images in enumerate(self._images)
        ]


class NoisyView:
    """Images of one camera with noise.

    Args:
        images: without noise, by hill pulse.
        sensor: adds it.
    """

    def __init__(self, images: dict[int, NDArray[np.uint16]], sensor: Sensor) -> None:
        self._images, self._sensor = images, sensor

    def render_into(self, out: Stored, pulse: HillPulse) -> None:
        """Render the image of hill pulse `pulse` into `out`, shape (height, width)."""
        self._sensor.read(self._images[pulse] * _SCALE, out, pulse)
