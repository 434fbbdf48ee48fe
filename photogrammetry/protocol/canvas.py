"""A small SVG canvas: world coordinates with y upwards, one scale for both axes."""

from collections.abc import Sequence
from html import escape

import numpy as np

from photogrammetry.adjustment.state import Floats

_WIDTH = 760.0
_MOST_HEIGHT = 760.0
_MARGIN = 40.0


class Canvas:
    """Draws into a rectangle of the world.

    Args:
        places: (n, 2) world coordinates that must fit, n >= 1.
    """

    def __init__(self, places: Floats) -> None:
        low, high = places.min(axis=0), places.max(axis=0)
        size = np.maximum(high - low, 1e-3 * max(float((high - low).max()), 1e-9))
        scale = min((_WIDTH - 2 * _MARGIN) / size[0], (_MOST_HEIGHT - 2 * _MARGIN) / size[1])
        self._scale, self._low = float(scale), low
        self._width, self._height = (float(value) for value in size * scale + 2 * _MARGIN)
        self._parts: list[str] = []

    @property
    def unit(self) -> float:
        """Length of one drawn pixel in the world."""
        return 1.0 / self._scale

    def line(self, start: Floats, end: Floats, colour: str) -> None:
        """A line."""
        (x1, y1), (x2, y2) = self._at(start), self._at(end)
        self._parts.append(f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}"/>')

    def dot(self, place: Floats, colour: str, radius: float = 2.5) -> None:
        """A filled circle of some pixels."""
        x, y = self._at(place)
        self._parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" fill="{colour}"/>')

    def triangle(self, place: Floats, colour: str) -> None:
        """A filled triangle: a camera."""
        x, y = self._at(place)
        corners = f"{x:.1f},{y - 7:.1f} {x - 6:.1f},{y + 5:.1f} {x + 6:.1f},{y + 5:.1f}"
        self._parts.append(f'<polygon points="{corners}" fill="{colour}"/>')

    def ellipse(self, place: Floats, covariance: Floats, magnified: float, colour: str) -> None:
        """The one-sigma ellipse of a (2, 2) covariance."""
        values, vectors = np.linalg.eigh(covariance)
        small, large = np.sqrt(np.maximum(values, 0.0)) * magnified * self._scale
        turn = -np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))  # y points downwards on the page
        x, y = self._at(place)
        self._parts.append(
            f'<ellipse rx="{large:.1f}" ry="{small:.1f}" fill="none" stroke="{colour}" '
            f'transform="translate({x:.1f} {y:.1f}) rotate({turn:.1f})"/>'
        )

    def text(self, place: Floats, words: str) -> None:
        """Words beside a place."""
        x, y = self._at(place)
        self._parts.append(f'<text x="{x + 5:.1f}" y="{y - 5:.1f}" font-size="10" fill="#555">{escape(words)}</text>')

    def svg(self) -> str:
        """The drawing."""
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {self._width:.0f} {self._height:.0f}" '
            f'width="{self._width:.0f}" height="{self._height:.0f}">{"".join(self._parts)}</svg>'
        )

    def _at(self, place: Floats | Sequence[float]) -> tuple[float, float]:
        x, y = (np.asarray(place, dtype=float) - self._low) * self._scale + _MARGIN
        return float(x), self._height - float(y)
