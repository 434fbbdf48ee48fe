"""Renders scenes in which nothing but the jumper and the noise change: fast, since the hill is rendered once."""

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from rig.images.pixels import Stored
from rig.pulse import HillPulse
from simrig.images import exposure
from simrig.images.scene.background import paint
from simrig.images.scene.balls import Balls
from simrig.images.scene.figure import Figure
from simrig.world.jumper import JumpSeries
from simrig.world.scenario import BRIGHTEST, Scenario

_NOISES = 6  #: realisations of the noise on the background
_NOISE_KEY = struct.Struct(">IBQ")


class StillView:
    """Renders one camera's images.

    The constructor renders the empty hill once, with a handful of noise realisations. A frame is a copy of one of
    them, with the jumper drawn in a small patch.

    Args:
        scenario: what there is to see.
        camera: index of the camera in it.
        width: width of the image, px.
        height: height of the image, px.
        rate_hz: rate of the pulses.
        rng: decides the noise.
        bits: of a pixel.
    """

    def __init__(
        self, scenario: Scenario, camera: int, width: int, height: int, rate_hz: float, rng: np.random.Generator,
        bits: int = 8,
    ) -> None:  # fmt: skip
        self._scenario = scenario
        self._camera = camera
        self._rate_hz = rate_hz
        self._jumps = JumpSeries(scenario)
        settings, image = scenario.cameras[camera], scenario.image
        projection = settings.projection(width, height)
        radiance = paint(scenario, projection)
        Balls(scenario, projection).draw(radiance, projection)
        clean = image.black_level + settings.gain * np.clip(radiance, 0, BRIGHTEST)
        self._clean = np.rint(clean).astype(np.uint8)
        self._scale = np.float32(2.0 ** (bits - 8))
        self._white = (1 << bits) - 1
        self._noisy: list[Stored] = [_quantized(clean, bits)]
        if image.noise_sigma:
            self._noisy = [_with_noise(clean, image.noise_sigma, rng, bits) for _ in range(_NOISES)]
        self._projection = projection
        self._exposure_s = settings.exposure_us / 1e6
        self._figure = Figure(scenario, projection, image.black_level, settings.gain)

    def render_into(self, out: Stored, pulse: HillPulse) -> None:
        """Render the image of hill pulse `pulse` into `out`, shape (height, width); its rows may lie apart."""
        noise = zlib.crc32(_NOISE_KEY.pack(self._scenario.seed, self._camera, pulse)) % len(self._noisy)
        np.copyto(out, self._noisy[noise])
        self._draw_jumper(out, pulse, self._noisy[noise - 1])

    def _draw_jumper(self, out: Stored, pulse: HillPulse, other: Stored) -> None:
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
        sprite += np.divide(other[rows, columns], self._scale, dtype=np.float32)
        sprite -= self._clean[rows, columns]
        sprite *= self._scale
        out[rows, columns] = np.clip(np.rint(sprite, out=sprite), 0, self._white, out=sprite)


def _with_noise(clean: NDArray[np.float32], sigma: float, rng: np.random.Generator, bits: int) -> Stored:
    noisy = rng.standard_normal(clean.shape, np.float32)
    noisy *= sigma
    noisy += clean
    return _quantized(noisy, bits)


def _quantized(grey: NDArray[np.float32], bits: int) -> Stored:
    """Whole numbers of so many bits from grey levels of eight bits."""
    values = grey * np.float32(2.0 ** (bits - 8))
    np.clip(np.rint(values, out=values), 0, (1 << bits) - 1, out=values)
    return values.astype(np.uint8) if bits == 8 else values.astype(np.uint16)
