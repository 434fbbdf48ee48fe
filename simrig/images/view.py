"""One camera's view of the simulated hill: the image of every hill pulse."""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from simrig.images import stamp
from simrig.images.background import paint
from simrig.images.figure import Figure
from simrig.images.snowfall import Snowfall
from simrig.world.jumper import JumpSeries
from simrig.world.scenario import Scenario

_NOISES = 6  #: realisations of the noise on the background
_NOISE_KEY = struct.Struct(">IBQ")


class CameraView:
    """Renders one camera's images. Deterministic: seed, camera and pulse decide every pixel.

    The empty hill is rendered once, with a handful of noise realisations; a frame is one of them, copied, plus the
    jumper and the snow in small patches. Not for use by two threads at once.

    Args:
        scenario: what there is to see.
        camera: index of the camera in the scenario.
        width: of the image, px; the view is the same at every width.
        height: of the image, px.
        rate_hz: of the pulses; hill pulse n shows scene time n / rate_hz.

    Raises:
        IndexError: the scenario has no such camera.
    """

    def __init__(self, scenario: Scenario, camera: int, width: int, height: int, rate_hz: float) -> None:
        self._scenario = scenario
        self._camera = camera
        self._rate_hz = rate_hz
        self._jumps = JumpSeries(scenario)
        settings, image = scenario.cameras[camera], scenario.image
        projection = settings.projection(width, height)
        clean = image.black_level + settings.gain * paint(scenario, projection)
        self._clean = np.rint(clean).astype(np.uint8)
        rng = np.random.default_rng((scenario.seed, camera, 99))
        self._noisy = [self._clean]
        if image.noise_sigma:
            self._noisy = [_with_noise(clean, image.noise_sigma, rng) for _ in range(_NOISES)]
        self._snow = Snowfall(image.snow_flakes, width, height, rng)
        self._figure = Figure(scenario, settings, projection, self._clean)

    def render_into(self, out: NDArray[np.uint8], pulse: int) -> None:
        """Render the image of hill pulse `pulse` into `out`, shape (height, width); its rows may lie apart."""
        noise = zlib.crc32(_NOISE_KEY.pack(self._scenario.seed, self._camera, pulse)) % len(self._noisy)
        np.copyto(out, self._noisy[noise])
        self._draw_jumper(out, pulse, self._noisy[noise - 1])
        self._snow.draw(out, pulse / self._rate_hz)
        if self._scenario.stamp:
            stamp.write(out, self._camera, pulse)

    def _draw_jumper(self, out: NDArray[np.uint8], pulse: int, other: NDArray[np.uint8]) -> None:
        """The jumper gets the noise of another realisation, so that it does not repeat the background's."""
        there = self._jumps.at_pulse(pulse, self._rate_hz)
        drawn = there and self._figure.draw(there[0].pose(there[1]))
        if not drawn:
            return
        rows, columns, sprite = drawn
        sprite += other[rows, columns]
        sprite -= self._clean[rows, columns]
        out[rows, columns] = np.clip(np.rint(sprite, out=sprite), 0, 255, out=sprite)


def _with_noise(clean: NDArray[np.float32], sigma: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    noisy = rng.standard_normal(clean.shape, np.float32)
    noisy *= sigma
    noisy += clean
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
