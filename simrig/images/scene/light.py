"""Draws light that should not be there: glare in the lens, reflections on the snow."""

import math

import numpy as np

from simrig.images.scene.drawing import Blob, Image
from simrig.world.projection import Projection
from simrig.world.scenario import BRIGHTEST, Scenario

_RADIUS_PX = (0.8, 2.2)  #: of reflections: like markers and balls
_SIZES = 4
_ON = 0.35  #: a reflection is to be seen while its wave is above this


def glare(spots: int, width: int, height: int, rng: np.random.Generator) -> Image:
    """Light that lamps outside of the view throw into a lens, radiance to be added; shape (h, w)."""
    light = np.zeros((height, width), np.float32)
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    for _ in range(spots):
        x, y, radius = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(0.01, 0.06) * width
        square = ((columns - x) ** 2 + (rows - y) ** 2) / np.float32(radius**2)
        light += np.float32(rng.uniform(15, 90)) * np.exp(-square)
    return light


class Reflections:
    """Bright spots on the snow that come and go.

    Args:
        scenario: says how many; seeds places and times, which are the same for all cameras.
        camera: index of the camera: not every camera sees the same sparkle.
    """

    def __init__(self, scenario: Scenario, camera: int) -> None:
        rng = np.random.default_rng((scenario.seed, 47))
        count = scenario.light.reflections
        x, y = rng.uniform(-4, 40, count), rng.uniform(-9, 14, count)
        self._places = np.stack((x, y, scenario.hill.snow(x, y)), axis=1)
        own = np.random.default_rng((scenario.seed, camera, 48))
        self._rates = own.uniform(0.8, 6.0, count)
        self._phases = own.uniform(0, 2 * math.pi, count)
        self._sizes = own.integers(0, _SIZES, count)
        self._blobs = [Blob(radius, scenario.image.blur_sigma_px) for radius in np.linspace(*_RADIUS_PX, _SIZES)]

    def draw(self, image: Image, projection: Projection, scene_s: float) -> None:
        """Draw those of scene time `scene_s` into an image of radiance, shape (h, w), in place."""
        strength = np.sin(self._rates * scene_s + self._phases)
        on = (strength > _ON) & (projection.distance(self._places) > 2)
        pixels = projection.pixels(self._places)
        for i in np.flatnonzero(on & projection.sees(pixels)):
            x, y = pixels[i]
            self._blobs[self._sizes[i]].draw(image, x, y, BRIGHTEST * float(strength[i]))
