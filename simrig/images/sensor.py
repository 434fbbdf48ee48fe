"""Turns radiance into the grey values of a sensor: gain, black level, the noise of light and of reading out."""

import struct
import zlib

import cv2
import numpy as np

from rig.images.pixels import Stored
from rig.pulse import HillPulse
from simrig.images.scene.drawing import Image
from simrig.world.scenario import ImageEffects

_KEY = struct.Struct(">IBQ")
_FIELDS = 2  #: realisations of the noise, each larger than the image by
_SPARE = 61  #: this many rows and columns; every pulse takes another part of one of them


class Sensor:
    """Deterministic: seed, camera and pulse decide the noise of every pixel.

    Args:
        effects: black level and noise.
        seed: seed of the scenario.
        camera: index of the camera.
        shape: rows and columns of the image.
        bits: of a pixel.
    """

    def __init__(self, effects: ImageEffects, seed: int, camera: int, shape: tuple[int, int], bits: int = 8) -> None:
        self._scale, self._white = np.float32(2.0 ** (bits - 8)), (1 << bits) - 1
        self._effects, self._key, self._shape = effects, (seed, camera), shape
        self._fields: list[Image] = []
        if effects.noise_sigma or effects.electrons_per_grey:
            rng = np.random.default_rng((seed, camera, 98))
            size = shape[0] + _SPARE, shape[1] + _SPARE
            self._fields = [rng.standard_normal(size, np.float32) for _ in range(_FIELDS)]
        self._noise = np.empty(shape, np.float32)

    def read(self, light: Image, out: Stored, pulse: HillPulse) -> None:
        """Turn an image without noise, in grey values, into what the sensor gives; `light` is used up.

        Args:
            light: shape (h, w).
            out: the image; its rows may lie apart.
            pulse: hill pulse.
        """
        if self._fields:
            self._add_noise(light, pulse)
        np.maximum(light, 0, out=light)
        if out.dtype == np.uint8:
            out[...] = cv2.convertScaleAbs(light)
        else:
            light *= self._scale
            np.rint(np.minimum(light, self._white, out=light), out=light)
            out[...] = light

    def _add_noise(self, light: Image, pulse: HillPulse) -> None:
        number = zlib.crc32(_KEY.pack(*self._key, pulse))
        field, row, column = number % _FIELDS, number // 7 % _SPARE, number // 1009 % _SPARE
        part = self._fields[field][row : row + self._shape[0], column : column + self._shape[1]]
        effects, noise = self._effects, self._noise
        if effects.electrons_per_grey:
            np.subtract(light, np.float32(effects.black_level), out=noise)
            np.maximum(noise, 0, out=noise)
            noise *= np.float32(1 / effects.electrons_per_grey)
            noise += np.float32(effects.noise_sigma**2)
            np.sqrt(noise, out=noise)
            noise *= part
        else:
            np.multiply(part, np.float32(effects.noise_sigma), out=noise)
        light += noise
