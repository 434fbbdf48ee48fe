"""Draws SVG in page units: 360 are the width of a phone and half that of a desktop. The page defines the colours."""

from collections.abc import Iterable
from enum import StrEnum
from html import escape

WIDTH = 360.0
FONT = 10.0
_LETTER = 0.56  # width of a letter / font size, on average


class Colour(StrEnum):
    """Colours that the page defines, for light and dark."""

    INK = "ink"
    SOFT = "soft"
    FAINT = "faint"
    BLUE = "blue"
    RED = "red"
    GREEN = "green"
    AMBER = "amber"


class Svg:
    """Collects shapes; y points downwards."""

    def __init__(self, height: float) -> None:
        self.height = height
        self._parts: list[str] = []
        self._taken: list[tuple[float, float, float, float]] = []
        self._linked = False

    def line(self, ends: tuple[float, float, float, float], colour: Colour, *, width: float = 1.0) -> None:
        """A line from (x1, y1) to (x2, y2)."""
        x1, y1, x2, y2 = ends
        self._parts.append(
            f'<line class="{colour}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke-width="{width:g}"/>'
        )

    def path(self, places: Iterable[tuple[float, float]], colour: Colour, *, width: float = 1.5) -> None:
        """A line through many places."""
        text = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        self._parts.append(f'<polyline class="{colour}" points="{text}" fill="none" stroke-width="{width:g}"/>')

    def area(self, places: Iterable[tuple[float, float]], colour: Colour) -> None:
        """A pale area with these corners."""
        text = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        self._parts.append(f'<polygon class="{colour}" points="{text}" fill-opacity="0.25"/>')

    def dot(self, x: float, y: float, colour: Colour, radius: float = 2.0) -> None:
        """A filled circle; labels keep away from it."""
        self._taken.append((x - radius, y - radius, x + radius, y + radius))
        self._parts.append(f'<circle class="{colour}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}"/>')

    def linked_dot(self, x: float, y: float, colour: Colour, href: str, words: str) -> None:
        """A filled circle that leads to another page; `words` say what it is."""
        self._linked = True
        self._parts.append(
            f'<a href="{escape(href)}" tabindex="-1"><title>{escape(words)}</title>'
            f'<circle class="{colour}" cx="{x:.1f}" cy="{y:.1f}" r="2"/></a>'
        )

    def ring(self, x: float, y: float, colour: Colour) -> None:
        """An open circle."""
        self._parts.append(f'<circle class="{colour}" cx="{x:.1f}" cy="{y:.1f}" r="2.2" fill="none"/>')

    def triangle(self, x: float, y: float, colour: Colour) -> None:
        """A filled triangle."""
        corners = f"{x:.1f},{y - 5:.1f} {x - 4.5:.1f},{y + 3.5:.1f} {x + 4.5:.1f},{y + 3.5:.1f}"
        self._parts.append(f'<polygon class="{colour}" points="{corners}"/>')

    def box(self, x: float, y: float, width: float, height: float, colour: Colour) -> None:
        """A filled rectangle."""
        self._parts.append(
            f'<rect class="{colour}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{max(height, 0.0):.1f}"/>'
        )

    def ellipse(self, x: float, y: float, axes: tuple[float, float], turn_deg: float, colour: Colour) -> None:
        """An open ellipse, its long axis turned clockwise."""
        self._parts.append(
            f'<ellipse class="{colour}" rx="{axes[0]:.2f}" ry="{axes[1]:.2f}" fill="none" '
            f'transform="translate({x:.1f} {y:.1f}) rotate({turn_deg:.1f})"/>'
        )

    def text(self, x: float, y: float, words: str, anchor: str = "start") -> None:
        """Words at a place."""
        self._parts.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}">{escape(words)}</text>')

    def label(self, x: float, y: float, words: str) -> None:
        """Words beside a place, clear of dots and other labels; left out if there is no room."""
        wide, high = FONT * _LETTER * len(words), FONT
        beside, above, below, middle = (4.0, -4.0 - wide), -3.0, high + 1.0, -wide / 2.0
        corners = [(dx, dy) for dy in (above, below) for dx in beside]
        for dx, dy in (*corners, (middle, 2.0 * above), (middle, below + 3.0)):
            left, base = x + dx, y + dy
            box = (left, base - 0.75 * high, left + wide, base)
            if box[0] > 0.0 and box[2] < WIDTH and not any(_overlap(box, other) for other in self._taken):
                self._taken.append(box)
                self.text(left, base, words)
                return

    def rendered(self, words: str) -> str:
        """The drawing as text; `words` describe it for screen readers."""
        role = "group" if self._linked else "img"
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:.0f} {self.height:.0f}" role="{role}" '
            f'aria-label="{escape(words)}">{"".join(self._parts)}</svg>'
        )


def _overlap(one: tuple[float, float, float, float], other: tuple[float, float, float, float]) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
