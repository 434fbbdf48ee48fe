"""What became of each point and ski, pulse by pulse: a drawing, and sentences about what has no raw solution."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import Final

from analysis.measurements.model import POINTS, SIDES
from analysis.result.fates import Fate, ImageFate
from analysis.result.model import Jump, PulseState
from photogrammetry.reports.document import Drawing
from photogrammetry.reports.drawing.svg import FONT, WIDTH, Colour, Svg

#: Said of pulses in which a point or a ski has no raw solution.
WHY: Final = {
    Fate.OUT_OF_SIGHT: "within the pictures of fewer than two cameras",
    Fate.NOT_FOUND: "measured in fewer than two images",
    Fate.UNDETERMINED: "its rays or planes coincide within their accuracy",
    Fate.DISAGREE: "its images contradict each other, and no single one is found to be wrong",
    Fate.MOTION: "too few images control it, and the motion of the whole jump contradicts it",
    Fate.NAME: "measured, but it may be something else on the jumper",
}
CAPTION: Final = (
    "What became of each point and ski. Thick: green has a raw solution, grey was not found in two images, red was "
    "refused. Thin, {cameras} in this order: green is used, amber is left out by the model over time, red contradicts "
    "the other images, blue is measured but without solution, grey is not found. Empty: out of sight, or no frame."
)
_PART: Final = {
    Fate.USED: Colour.GREEN,
    Fate.NOT_FOUND: Colour.FAINT,
    Fate.OUT_OF_SIGHT: None,
}  # all others are refused
_IMAGE: Final = {
    ImageFate.USED: Colour.GREEN,
    ImageFate.RAW_ONLY: Colour.AMBER,
    ImageFate.GROSS_ERROR: Colour.RED,
    ImageFate.NOT_USED: Colour.BLUE,
    ImageFate.NOT_FOUND: Colour.FAINT,
}
_LEFT, _RIGHT = 42.0, 4.0  # margins
_THICK, _THIN, _GAP = 9.0, 3.0, 6.0


def why_missing(jump: Jump) -> Iterator[tuple[str, Fate, list[PulseState]]]:
    """Points and skis without a raw solution: which, why, and at which pulses."""
    for what in (*POINTS, *SIDES):
        for fate in WHY:
            pulses = [pulse for pulse in jump.pulses if what in pulse.fates and pulse.fates[what].fate is fate]
            if pulses:
                yield what, fate, pulses


def fates_drawing(jump: Jump) -> Drawing | None:
    """A row for each point and ski, below it one for each camera; None where the result does not say it."""
    pulses = [pulse for pulse in jump.pulses if pulse.fates]
    if not pulses:
        return None
    cameras = list(pulses[0].fates[POINTS[0]].images)
    each = _THICK + _THIN * len(cameras) + _GAP
    parts = (*POINTS, *SIDES)
    svg = Svg(each * len(parts) + FONT + _GAP)
    wide = (WIDTH - _LEFT - _RIGHT) / len(pulses)
    for row, what in enumerate(parts):
        y = row * each + _GAP / 2
        svg.text(_LEFT - _GAP / 2, y + _THICK, what, "end")
        fates = [pulse.fates[what] for pulse in pulses]
        _strip(svg, [_PART.get(part.fate, Colour.RED) for part in fates], (y, _THICK), wide)
        for k, camera in enumerate(cameras):
            images = [_IMAGE.get(part.images.get(camera, ImageFate.NO_FRAME)) for part in fates]
            _strip(svg, images, (y + _THICK + k * _THIN, _THIN - 1.0), wide)
    for place, anchor in ((0, "start"), (len(pulses) - 1, "end")):
        x = _LEFT if place == 0 else WIDTH - _RIGHT
        svg.text(x, svg.height - _GAP / 2, f"{'pulse ' if place == 0 else ''}{pulses[place].pulse}", anchor)
    caption = CAPTION.format(cameras=", ".join(cameras))
    return Drawing(caption, svg.rendered(caption))


def _strip(svg: Svg, colours: Sequence[Colour | None], row: tuple[float, float], wide: float) -> None:
    """One box for each run of pulses of one colour."""
    y, height = row
    for colour, first, count in _runs(colours):
        if colour is not None:
            svg.box(_LEFT + first * wide, y, count * wide, height, colour)


def _runs(colours: Iterable[Colour | None]) -> Iterator[tuple[Colour | None, int, int]]:
    first = 0
    for colour, run in groupby(colours):
        count = len(list(run))
        yield colour, first, count
        first += count
