"""A chart with axes: curves, dots, bars over round ticks."""

from collections.abc import Sequence

from photogrammetry.adjustment.state import Floats
from photogrammetry.protocol.scales import ticks
from photogrammetry.protocol.svg import FONT, WIDTH, Colour, Svg

_LEFT, _RIGHT, _TOP, _BOTTOM = 38.0, 15.0, 34.0, 32.0
_HEIGHT = 230.0


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
        """Place on the page."""
        low, high = self._x
        return _LEFT + (float(value) - low) / (high - low) * (WIDTH - _LEFT - _RIGHT)

    def y(self, value: float) -> float:
        """Place on the page."""
        low, high = self._y
        return _HEIGHT - _BOTTOM - (float(value) - low) / (high - low) * (_HEIGHT - _TOP - _BOTTOM)

    def curve(self, x: Floats, y: Floats, colour: Colour) -> None:
        """A line through (n,) values."""
        self.svg.path(((self.x(a), self.y(b)) for a, b in zip(x, y, strict=True)), colour)

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
        """A horizontal line all the way."""
        self.svg.line((_LEFT, self.y(y), WIDTH - _RIGHT, self.y(y)), colour)

    def legend(self, colour: Colour, words: str) -> None:
        """One more entry above the chart."""
        self.svg.dot(self._legend + 4.0, 22.0, colour, 3.5)
        self.svg.text(self._legend + 10.0, 25.5, words)
        self._legend += 20.0 + 0.56 * FONT * len(words)


def _number(value: float) -> str:
    return f"{value:.6g}".replace("-", "\N{MINUS SIGN}")
