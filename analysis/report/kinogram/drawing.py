"""The stick figure over a picture: coloured lines and points within dark and light edges, seen on any background."""

from collections.abc import Iterator
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis.report.overlay import COLOURS, SHIFT, Colour, Overlay, fine
from rig.arrays import Floats

Picture = NDArray[np.uint8]
DARK: Final[Colour] = (0, 0, 0)
LIGHT: Final[Colour] = (255, 255, 255)
#: Widths of lines: light edge, dark edge, colour, px.
WIDTHS: Final = (11, 8, 4)
#: Radii of points likewise; the helmet is larger.
RADII: Final = (9.0, 7.5, 5.5)
HELMET: Final = 1.4


class Line(NamedTuple):
    """A line (m, 2) of the stick figure."""

    part: str
    places: Floats


class Dot(NamedTuple):
    """A point of the stick figure."""

    name: str
    x: float
    y: float
    size: float  # 1 for a binding
    part: str
    seen: bool  # else it comes from the motion alone


def lines_of(overlay: Overlay) -> Iterator[Line]:
    """Skis from tail to tip, the line between the feet, body from helmet by hip to the feet."""
    for part in ("right", "left", "feet", "body"):
        if part in overlay.lines:
            yield Line(part, overlay.lines[part])


def dots_of(overlay: Overlay) -> Iterator[Dot]:
    """P3, P4, P2, P1, as far as they are known."""
    for name, part in (("P3", "right"), ("P4", "left"), ("P2", "body"), ("P1", "body")):
        if name in overlay.ellipses:
            x, y = overlay.ellipses[name][0]
            yield Dot(name, float(x), float(y), HELMET if name == "P1" else 1.0, part, name not in overlay.predicted)


def draw(picture: Picture, overlay: Overlay) -> None:
    """Draw the stick figure into a coloured picture (rows, columns, 3), RGB, in place."""
    lines, dots = list(lines_of(overlay)), list(dots_of(overlay))
    for step, edge in enumerate((LIGHT, DARK, None)):
        for line in lines:
            colour = edge or COLOURS[line.part]
            cv2.polylines(picture, [fine(line.places)], False, colour, WIDTHS[step], cv2.LINE_AA, SHIFT)
        for dot in dots:
            inner = COLOURS[dot.part] if dot.seen else DARK
            _disc(picture, dot, RADII[step] * dot.size, edge or inner)
    for dot in dots:
        if not dot.seen:
            radius = round(RADII[2] * dot.size * (1 << SHIFT))
            centre = fine(np.array((dot.x, dot.y)))
            cv2.circle(picture, (int(centre[0]), int(centre[1])), radius, COLOURS[dot.part], 2, cv2.LINE_AA, SHIFT)


def _disc(picture: Picture, dot: Dot, radius: float, colour: Colour) -> None:
    centre = fine(np.array((dot.x, dot.y)))
    size = round(radius * (1 << SHIFT))
    cv2.circle(picture, (int(centre[0]), int(centre[1])), size, colour, -1, cv2.LINE_AA, SHIFT)
