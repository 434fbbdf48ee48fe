"""Charts of a comparison: differences with their limits, and the values of both jumps; a drawing for each language."""

from collections.abc import Callable
from html import escape
from typing import Final

import numpy as np

from analysis.comparison.difference import LEVEL
from analysis.comparison.report import WORDS, Comparison
from analysis.report.compared.words import first_letter_large, quantity, said
from analysis.report.language import LANGUAGES, Language, Said, with_comma
from analysis.result.model import QUANTITIES
from photogrammetry.reports.drawing.svg import Colour
from photogrammetry.reports.drawing.to_scale import Chart, rounded_up
from rig.arrays import Floats

#: The athlete's own scatter is left out of a chart that it would make so many times higher.
_MOST_SCATTER: Final = 3.0
#: So is a limit that is so many times the usual one: at the ends, where little is known.
_MOST_LIMIT: Final = 3.0
_LEGEND: Final = ((Colour.BLUE, "line"), (Colour.SOFT, "limit"), (Colour.AMBER, "own_line"), (Colour.RED, "red"))


def difference_chart(comparison: Comparison, name: str) -> str:
    """A figure of B minus A over time."""
    own = _twice_scatter(comparison, QUANTITIES.index(name))
    top = _top(comparison, name)
    words = first_letter_large(said("chart", quantity=quantity(name), symbol=WORDS[name][1]))
    if (own >= top).any():
        words = Said(*(f"{one} {other}" for one, other in zip(words, said("large"), strict=True)))
    return _figure(words, lambda language: _difference(comparison, name, top, language))


def value_chart(comparison: Comparison, name: str) -> str:
    """A figure of both jumps over time."""
    words = first_letter_large(said("values", quantity=quantity(name), symbol=WORDS[name][1]))
    return _figure(words, lambda language: _values(comparison, name, language))


def _figure(words: Said, draw: Callable[[Language], Chart]) -> str:
    drawings = []
    for language in LANGUAGES:
        caption = words.of(language)
        svg = draw(language).svg.rendered(caption)
        svg = with_comma(svg) if language == "nb" else svg
        drawings.append(f'<div lang="{language}">{svg}<figcaption>{escape(caption)}</figcaption></div>')
    return f"<figure>{''.join(drawings)}</figure>"


def _top(comparison: Comparison, name: str) -> float:
    """The end of the axis: room for the differences, for limits and scatter as far as they are not much larger."""
    d, row = comparison.difference, QUANTITIES.index(name)
    known = np.isfinite(d.value[row])
    value, limit = d.value[row, known], d.limit * d.repeat[row, known]
    least = max(float(np.abs(value).max()), min(float(limit.max()), _MOST_LIMIT * float(np.median(limit))))
    own = _twice_scatter(comparison, row)[known]
    return rounded_up(1.1 * max([least, *own[own < _MOST_SCATTER * least]]))


def _difference(comparison: Comparison, name: str, top: float, language: Language) -> Chart:
    d, row = comparison.difference, QUANTITIES.index(name)
    known = np.isfinite(d.value[row])
    times, value, limit = d.times[known], d.value[row, known], d.limit * d.repeat[row, known]
    own = _twice_scatter(comparison, row)[known]
    axes = said("seconds").of(language), said("minus", unit=WORDS[name][2]).of(language)
    chart = Chart((float(times[0]), float(times[-1])), (-top, top), *axes)
    chart.rule(0.0, Colour.SOFT)
    drawn, different = own < top, d.p_greatest[row, known] < LEVEL
    for sign in (-1, 1):
        chart.curve(times[limit < top], sign * limit[limit < top], Colour.SOFT)
        chart.curve(times[drawn], sign * own[drawn], Colour.AMBER)
    chart.curve(times, value, Colour.BLUE)
    chart.dots(times[different], value[different], Colour.RED, 2.5)
    shown = (True, True, bool(drawn.any()), bool(different.any()))
    for colour, legend in (entry for entry, there in zip(_LEGEND, shown, strict=True) if there):
        chart.legend(colour, said(legend).of(language))
    return chart


def _twice_scatter(comparison: Comparison, row: int) -> Floats:
    """Twice the standard deviation (T,) of the difference of two of the athlete's own jumps; NaN if not known."""
    if comparison.scatter is None:
        return np.full(len(comparison.difference.times), np.nan)
    return np.asarray(2 * np.sqrt(2) * comparison.scatter.deviation[row])


def _values(comparison: Comparison, name: str, language: Language) -> Chart:
    d, row = comparison.difference, QUANTITIES.index(name)
    known = np.isfinite(d.value[row])
    times, a, b = d.times[known], d.a[row, known], d.b[row, known]
    low, high = float(min(a.min(), b.min())), float(max(a.max(), b.max()))
    room = max(0.05 * (high - low), 1e-6)
    ends = (float(times[0]), float(times[-1])), (low - room, high + room)
    chart = Chart(*ends, said("seconds").of(language), WORDS[name][2])
    for values, colour, legend in ((a, Colour.AMBER, "A"), (b, Colour.BLUE, "B")):
        chart.curve(times, values, colour)
        chart.legend(colour, legend)
    return chart
