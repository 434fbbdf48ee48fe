"""Drawing to scale: world coordinates with y upwards, one scale for both axes."""

import numpy as np

from photogrammetry.adjustment.state import Floats
from photogrammetry.protocol.scales import nice
from photogrammetry.protocol.svg import WIDTH, Colour, Svg

_MOST_HEIGHT = 400.0
_BAR = 0.25  # of the width, at most


class Canvas:
    """Draws into a rectangle of the world.

    Args:
        places: (n, 2) world coordinates that must fit, n >= 1.
        margin: left free at all sides, page units.
    """

    def __init__(self, places: Floats, margin: float = 26.0) -> None:
        low, high = places.min(axis=0), places.max(axis=0)
        size = np.maximum(high - low, 1e-3 * max(float((high - low).max()), 1e-9))
        room = WIDTH - 2 * margin, _MOST_HEIGHT - 2 * margin
        self._scale = float(min(room[0] / size[0], room[1] / size[1]))
        self._margin = margin
        self._low = low - np.array([(room[0] / self._scale - size[0]) / 2.0, 0.0])  # in the middle of the page
        self.svg = Svg(float(size[1] * self._scale) + 2 * margin)

    @property
    def unit(self) -> float:
        """Length of one unit of the page in the world."""
        return 1.0 / self._scale

    def at(self, place: Floats) -> tuple[float, float]:
        """Where a place of the world is on the page."""
        x, y = (np.asarray(place, dtype=float) - self._low) * self._scale + self._margin
        return float(x), self.svg.height - float(y)

    def line(self, start: Floats, end: Floats, colour: Colour, *, width: float = 1.0) -> None:
        """A line."""
        self.svg.line((*self.at(start), *self.at(end)), colour, width=width)

    def ellipse(self, place: Floats, covariance: Floats, magnified: float, colour: Colour) -> None:
        """The one-sigma ellipse of a (2, 2) covariance."""
        values, vectors = np.linalg.eigh(covariance)
        small, large = np.sqrt(np.maximum(values, 0.0)) * magnified * self._scale
        turn = -np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))  # y points downwards on the page
        self.svg.ellipse(*self.at(place), (float(large), float(small)), float(turn), colour)

    def scale_bar(self, unit: str, magnified: float = 1.0) -> None:
        """How long something of the world is drawn, at the bottom; `magnified` for what is drawn larger than it is."""
        drawn = magnified * self._scale
        length = nice(_BAR * WIDTH / drawn)
        x, y = WIDTH - 12.0, self.svg.height - 6.0
        self.svg.line((x - length * drawn, y, x, y), Colour.SOFT, width=2.0)
        self.svg.text(x - length * drawn - 4.0, y + 3.0, f"{length:g} {unit}".strip(), "end")

    def axes(self, right: str, up: str) -> None:
        """Names of the axes, at the bottom left."""
        x, y = 12.0, self.svg.height - 6.0
        self.svg.line((x, y, x + 16.0, y), Colour.SOFT)
        self.svg.line((x, y, x, y - 16.0), Colour.SOFT)
        self.svg.text(x + 19.0, y + 3.0, right)
        self.svg.text(x - 3.0, y - 19.0, up)
