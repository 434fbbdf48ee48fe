"""Drawing to scale: `Canvas` for places (one scale for both axes), `Chart` for curves over two axes, round numbers."""

import math
from collections.abc import Sequence

import numpy as np

from photogrammetry.reports.drawing.svg import FONT, WIDTH, Colour, Svg
from rig.arrays import Floats

_MOST_HEIGHT = 400.0
_BAR = 0.25  # of the width, at most
_LEFT, _RIGHT, _TOP, _BOTTOM = 38.0, 15.0, 34.0, 32.0
_HEIGHT = 230.0


class Canvas:
    """Draws into a rectangle of the world.

    Args:
        places: (n, 2) world coordinates that must fit, n >= 1.
        margin: free space on all sides, page units.
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
        """Length in the world of one page unit."""
        return 1.0 / self._scale

    def at(self, place: Floats) -> tuple[float, float]:
        """The place on the page of world coordinates (2,)."""
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
        """A bar of a round world length, at the bottom; `magnified`: factor by which what it measures is enlarged."""
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


class Chart:
    """Draws over two axes.

    Args:
        x: lowest and highest value.
        y: lowest and highest value.
        x_label: what runs to the right, with its unit.
        y_label: what runs upwards, with its unit.
        names: at x = 1, 2, ..., in place of round numbers.
    """

    def __init__(
        self,
        x: tuple[float, float],
        y: tuple[float, float],
        x_label: str,
        y_label: str,
        names: Sequence[str] = (),
    ) -> None:
        self.svg = Svg(_HEIGHT)
        self._x, self._y = x, y
        self._legend = _LEFT
        for value in ticks(*y, most=8):
            height = self.y(value)
            self.svg.line((_LEFT, height, WIDTH - _RIGHT, height), Colour.FAINT)
            self.svg.text(_LEFT - 4.0, height + 3.5, _number(value), "end")
        marks = [(float(i), name) for i, name in enumerate(names, 1)] or [(v, _number(v)) for v in ticks(*x, most=8)]
        for value, name in marks:
            self.svg.line((self.x(value), self.y(y[0]), self.x(value), self.y(y[0]) + 3.0), Colour.SOFT)
            self.svg.text(self.x(value), self.y(y[0]) + 13.0, name, "middle")
        self.svg.line((_LEFT, self.y(y[0]), WIDTH - _RIGHT, self.y(y[0])), Colour.SOFT)
        self.svg.text(WIDTH - _RIGHT, _HEIGHT - 4.0, x_label, "end")
        self.svg.text(4.0, 11.0, y_label)

    def x(self, value: float) -> float:
        """Horizontal place on the page of a value."""
        low, high = self._x
        return _LEFT + (float(value) - low) / (high - low) * (WIDTH - _LEFT - _RIGHT)

    def y(self, value: float) -> float:
        """Vertical place on the page of a value."""
        low, high = self._y
        return _HEIGHT - _BOTTOM - (float(value) - low) / (high - low) * (_HEIGHT - _TOP - _BOTTOM)

    def curve(self, x: Floats, y: Floats, colour: Colour) -> None:
        """A line through (n,) values."""
        self.svg.path(((self.x(a), self.y(b)) for a, b in zip(x, y, strict=True)), colour)

    def band(self, x: Floats, low: Floats, high: Floats, colour: Colour) -> None:
        """A pale area between (n,) values."""
        there = [(self.x(a), self.y(b)) for a, b in zip(x, low, strict=True)]
        back = [(self.x(a), self.y(b)) for a, b in zip(x, high, strict=True)]
        self.svg.area([*there, *reversed(back)], colour)

    def dots(self, x: Floats, y: Floats, colour: Colour, radius: float = 1.4) -> None:
        """A dot at each of (n,) values."""
        for a, b in zip(x, y, strict=True):
            self.svg.dot(self.x(a), self.y(b), colour, radius)

    def rings(self, x: Floats, y: Floats, colour: Colour) -> None:
        """An open circle at each of (n,) values."""
        for a, b in zip(x, y, strict=True):
            self.svg.ring(self.x(a), self.y(b), colour)

    def bars(self, edges: Floats, heights: Floats, colour: Colour) -> None:
        """Bars from 0 to (n,) heights between (n + 1,) edges."""
        for left, right, height in zip(edges[:-1], edges[1:], heights, strict=True):
            top = self.y(height)
            self.svg.box(self.x(left) + 0.5, top, self.x(right) - self.x(left) - 1.0, self.y(0.0) - top, colour)

    def spread(self, x: float, low: float, high: float, colour: Colour) -> None:
        """A vertical line from low to high."""
        self.svg.line((self.x(x), self.y(low), self.x(x), self.y(high)), colour, width=1.5)

    def rule(self, y: float, colour: Colour) -> None:
        """A horizontal line across the chart."""
        self.svg.line((_LEFT, self.y(y), WIDTH - _RIGHT, self.y(y)), colour)

    def upright(self, x: float, colour: Colour) -> None:
        """A vertical line through the chart."""
        self.svg.line((self.x(x), self.y(self._y[0]), self.x(x), self.y(self._y[1])), colour)

    def legend(self, colour: Colour, words: str) -> None:
        """One more entry above the chart."""
        self.svg.dot(self._legend + 4.0, 22.0, colour, 3.5)
        self.svg.text(self._legend + 10.0, 25.5, words)
        self._legend += 20.0 + 0.56 * FONT * len(words)


def _number(value: float) -> str:
    return f"{value:.6g}".replace("-", "\N{MINUS SIGN}")


def nice(value: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... (and 0.5, 0.2, ...) that is not above a positive value."""
    power = 10.0 ** math.floor(math.log10(value))
    factor = next(f for f in (5.0, 2.0, 1.0) if f * power <= value * (1.0 + 1e-9))
    return float(f"{factor * power:.1g}")


def ticks(low: float, high: float, most: int) -> list[float]:
    """At most `most` round numbers within low..high, evenly spaced."""
    step = nice((high - low) / most)
    while (last := math.floor(high / step + 1e-9)) - (first := math.ceil(low / step - 1e-9)) >= most:
        step = nice(2.5 * step)
    return [round(k * step, 12) for k in range(first, last + 1)]


def rounded_up(value: float) -> float:
    """A positive value or a little more, so that an axis from 0 ends on a tick."""
    step = nice(value / 5.0)
    return math.ceil(value / step - 1e-9) * step
