"""What one camera of the simulated hill sees: the image of every hill pulse."""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from rig.pulse import HillPulse
from simrig.images import exposure, stamp
from simrig.images.background import paint
from simrig.images.figure import Figure
from simrig.world.jumper import JumpSeries
from simrig.world.scenario import REFERENCE_WIDTH, Scenario

_NOISES = 6  #: realisations of the noise on the background
_NOISE_KEY = struct.Struct(">IBQ")
_FLAKE_HALF = 3  #: a flake is drawn in a square of 2 * 3 + 1 px
_FLAKE_GREY = 215.0


class CameraView:
    """Renders one camera's images. Deterministic: seed, camera and pulse decide every pixel.

    The constructor renders the empty hill once, with a handful of noise realisations. A frame is a copy of one of
    them, with the jumper and the snow drawn in small patches. Not for use by two threads at once.

    Args:
        scenario: what there is to see.
        camera: index of the camera in the scenario.
        width: width of the image, px; the field of view is the same at every width.
        height: height of the image, px.
        rate_hz: rate of the pulses; hill pulse n shows scene time n / rate_hz.

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
        self._projection = projection
        self._exposure_s = settings.exposure_us / 1e6
        self._figure = Figure(scenario, projection, image.black_level, settings.gain)

    def render_into(self, out: NDArray[np.uint8], pulse: HillPulse) -> None:
        """Render the image of hill pulse `pulse` into `out`, shape (height, width); its rows may lie apart."""
        noise = zlib.crc32(_NOISE_KEY.pack(self._scenario.seed, self._camera, pulse)) % len(self._noisy)
        np.copyto(out, self._noisy[noise])
        self._draw_jumper(out, pulse, self._noisy[noise - 1])
        self._snow.draw(out, pulse / self._rate_hz)
        if self._scenario.stamp:
            stamp.write(out, self._camera, pulse)

    def _draw_jumper(self, out: NDArray[np.uint8], pulse: HillPulse, other: NDArray[np.uint8]) -> None:
        """Draw the jumper with the noise of another realisation than the background's around it."""
        there = self._jumps.at(self._scenario.cameras[self._camera].middle_s(pulse, self._rate_hz))
        if there is None:
            return
        jump, time_s = there
        poses = exposure.poses(jump, time_s, self._exposure_s, self._projection)
        drawn = self._figure.draw(poses, self._projection, self._clean, self._scenario.jumper.worn(jump.number))
        if not drawn:
            return
        rows, columns, sprite = drawn
        sprite += other[rows, columns]
        sprite -= self._clean[rows, columns]
        out[rows, columns] = np.clip(np.rint(sprite, out=sprite), 0, 255, out=sprite)


class Snowfall:
    """Snow flakes that fall at their own speeds and re-enter at the top; the same time gives the same flakes.

    Args:
        flakes: number of flakes.
        width: width of the image, px.
        height: height of the image, px.
        rng: decides where the flakes start and how they look.
    """

    def __init__(self, flakes: int, width: int, height: int, rng: np.random.Generator) -> None:
        self._size = np.array((width, height), float)
        self._start = rng.uniform(0, 1, (flakes, 2)) * self._size
        speed = np.stack((rng.normal(35, 20, flakes), rng.uniform(60, 190, flakes)), axis=1)
        self._speed = speed * width / REFERENCE_WIDTH
        self._variance = rng.uniform(0.5, 1.3, (flakes, 1)) ** 2
        self._strength = rng.uniform(0.2, 0.95, (flakes, 1, 1))
        self._steps = np.arange(-_FLAKE_HALF, _FLAKE_HALF + 1)

    def draw(self, image: NDArray[np.uint8], time_s: float) -> None:
        """Draw the flakes of scene time `time_s` into `image` (h, w), in place."""
        if not len(self._start):
            return
        place = np.mod(self._start + self._speed * time_s, self._size - 2 * _FLAKE_HALF - 1) + _FLAKE_HALF
        pixel = place.astype(np.intp)
        columns = pixel[:, :1] + self._steps
        rows = pixel[:, 1:] + self._steps
        across = np.exp(-((columns - place[:, :1]) ** 2) / (2 * self._variance))
        down = np.exp(-((rows - place[:, 1:]) ** 2) / (2 * self._variance))
        cover = self._strength * down[:, :, None] * across[:, None, :]
        where = rows[:, :, None], columns[:, None, :]
        below = image[where]
        image[where] = below + cover * (_FLAKE_GREY - below)


def _with_noise(clean: NDArray[np.float32], sigma: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    noisy = rng.standard_normal(clean.shape, np.float32)
    noisy *= sigma
    noisy += clean
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
