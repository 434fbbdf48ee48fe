"""Snow flakes that drift through one camera's image."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_HALF = 3  #: a flake is drawn in a square of 2 * 3 + 1 px
_GREY = 215.0


class Snowfall:
    """Flakes that fall at their own speed and come back at the top; the same time gives the same flakes.

    Args:
        flakes: how many there are.
        width: of the image, px.
        height: likewise.
        rng: where they start and how they look.
    """

    def __init__(self, flakes: int, width: int, height: int, rng: np.random.Generator) -> None:
        self._size = np.array((width, height), float)
        self._start = rng.uniform(0, 1, (flakes, 2)) * self._size
        speed = np.stack((rng.normal(35, 20, flakes), rng.uniform(60, 190, flakes)), axis=1)
        self._speed = speed * width / 640
        self._variance = rng.uniform(0.5, 1.3, (flakes, 1)) ** 2
        self._strength = rng.uniform(0.2, 0.95, (flakes, 1, 1))
        self._steps = np.arange(-_HALF, _HALF + 1)

    def draw(self, image: NDArray[np.uint8], time_s: float) -> None:
        """Draw the flakes of scene time `time_s` into `image` (h, w), in place."""
        if not len(self._start):
            return
        place = np.mod(self._start + self._speed * time_s, self._size - 2 * _HALF - 1) + _HALF
        pixel = place.astype(np.intp)
        columns = pixel[:, :1] + self._steps
        rows = pixel[:, 1:] + self._steps
        across = np.exp(-((columns - place[:, :1]) ** 2) / (2 * self._variance))
        down = np.exp(-((rows - place[:, 1:]) ** 2) / (2 * self._variance))
        cover = self._strength * down[:, :, None] * across[:, None, :]
        where = rows[:, :, None], columns[:, None, :]
        below = image[where]
        image[where] = below + cover * (_GREY - below)
