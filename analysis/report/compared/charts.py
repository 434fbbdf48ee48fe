"""Charts of a comparison: differences with their limits, and the values of both jumps; a drawing for each language."""

import re
from collections.abc import Callable
from html import escape
from typing import Final

import numpy as np

from analysis.comparison.difference import LEVEL
from analysis.comparison.report import WORDS, Comparison
from analysis.report.compared.words import Language, first_letter_large, localised, quantity, said
from analysis.result.model import QUANTITIES
from photogrammetry.reports.drawing.svg import Colour
from photogrammetry.reports.drawing.to_scale import Chart, rounded_up
from rig.arrays import Floats

#: The athlete's own scatter is left out of a chart that it would make so many times higher.
_MOST_SCATTER: Final = 3.0
#: So is a limit that is so many times the usual one: at the ends, where little is known.
_MOST_LIMIT: Final = 3.0
_LEGEND: Final = ((Colour.BLUE, "line"), (Colour.SOFT, "limit"), (Colour.AMBER, "own_line"), (Colour.RED, "red"))
_Drawn = tuple[Chart, str]


def difference_chart(comparison: Comparison, name: str) -> str:
    """A figure of B minus A over time."""
    return _figure(lambda language: _difference(comparison, name, language))


def value_chart(comparison: Comparison, name: str) -> str:
    """A figure of both jumps over time."""
    return _figure(lambda language: _values(comparison, name, language))


def _figure(draw: Callable[[Language], _Drawn]) -> str:
    drawings = []
    for language in Language:
        chart, caption = draw(language)
        svg = re.sub(r">([^<>]+)<", lambda words: f">{localised(language, words[1])}<", chart.svg.rendered(caption))  # noqa: B023
        drawings.append(f'<div lang="{language}">{svg}<figcaption>{escape(caption)}</figcaption></div>')
    return f"<figure>{''.join(drawings)}</figure>"


def _difference(comparison: Comparison, name: str, language: Language) -> _Drawn:
    d, row = comparison.difference, QUANTITIES.index(name)
    known = np.isfinite(d.value[row])
    times, value, limit = d.times[known], d.value[row, known], d.limit * d.repeat[row, known]
    least = max(float(np.abs(value).max()), min(float(limit.max()), _MOST_LIMIT * float(np.median(limit))))
    own = _twice_scatter(comparison, row)[known]
    top = rounded_up(1.1 * max([least, *own[own < _MOST_SCATTER * least]]))
    axes = said(language, "seconds"), said(language, "minus", unit=WORDS[name][2])
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
        chart.legend(colour, said(language, legend))
    caption = _caption(language, "chart", name)
    return chart, f"{caption} {said(language, 'large')}" if (own >= top).any() else caption


def _twice_scatter(comparison: Comparison, row: int) -> Floats:
    """Twice the standard deviation (T,) of the difference of two of the athlete's own jumps; NaN if not known."""
    if comparison.scatter is None:
        return np.full(len(comparison.difference.times), np.nan)
    return np.asarray(2 * np.sqrt(2) * comparison.scatter.deviation[row])


def _values(comparison: Comparison, name: str, language: Language) -> _Drawn:
    d, row = comparison.difference, QUANTITIES.index(name)
    known = np.isfinite(d.value[row])
    times, a, b = d.times[known], d.a[row, known], d.b[row, known]
    low, high = float(min(a.min(), b.min())), float(max(a.max(), b.max()))
    room = max(0.05 * (high - low), 1e-6)
    ends = (float(times[0]), float(times[-1])), (low - room, high + room)
    chart = Chart(*ends, said(language, "seconds"), WORDS[name][2])
    for values, colour, legend in ((a, Colour.AMBER, "A"), (b, Colour.BLUE, "B")):
        chart.curve(times, values, colour)
        chart.legend(colour, legend)
    return chart, _caption(language, "values", name)


def _caption(language: Language, key: str, name: str) -> str:
    return first_letter_large(said(language, key, quantity=quantity(language, name), symbol=WORDS[name][1]))
