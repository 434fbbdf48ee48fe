"""The drawings of the page: dots of jumps that lead to their reports, means with bands, drifts of cameras."""

from collections.abc import Callable
from typing import Final

import numpy as np

from photogrammetry.reports.drawing.svg import WIDTH, Colour, Svg
from photogrammetry.reports.drawing.to_scale import Chart, ticks
from rig.arrays import Floats
from season.page.content import Athlete, Drift, Means

_ROW: Final = 34.0
_MARGIN: Final = 8.0
_COLOURS: Final = (Colour.BLUE, Colour.AMBER, Colour.GREEN, Colour.RED, Colour.INK, Colour.SOFT)
#: Room above and below, of the largest value: the ticks of an axis have four digits then.
_LEAST: Final = 0.01
#: Dots above each other, so that equal values are seen.
_LEVELS: Final = 5
Link = Callable[[str], str]


def span_of(values: Floats) -> tuple[float, float]:
    """Lowest and highest value, with some room; of values that are nearly equal so much that scales stay short."""
    low, high = float(values.min()), float(values.max())
    room = max(0.04 * (high - low), _LEAST * max(abs(low), abs(high))) or 1.0
    return low - room, high + room


def strip(athlete: Athlete, span: tuple[float, float], link: Link, words: str) -> str:
    """All jumps of an athlete over a quantity, with his mean and twice its standard deviation."""
    svg = Svg(_ROW)

    def place(value: float) -> float:
        return _MARGIN + (value - span[0]) / (span[1] - span[0]) * (WIDTH - 2 * _MARGIN)

    svg.line((_MARGIN, _ROW - 5, WIDTH - _MARGIN, _ROW - 5), Colour.FAINT)
    dots = athlete.dots
    for at, value in enumerate(dots.values.tolist()):
        y = _ROW - 9 - 4.0 * (at % _LEVELS)
        svg.linked_dot(place(value), y, Colour.BLUE, link(dots.reports[at]), f"{dots.words[at]}: {value:.4g}")
    mean, sigma = athlete.group.mean, athlete.group.sigma_mean
    svg.line((place(mean - 2 * sigma), _ROW - 3, place(mean + 2 * sigma), _ROW - 3), Colour.INK, width=3.0)
    svg.line((place(mean), 2.0, place(mean), _ROW), Colour.INK, width=1.5)
    return svg.rendered(words)


def scale(span: tuple[float, float], unit: str) -> str:
    """The scale of strips, to stand above them."""
    svg = Svg(16.0)
    for value in ticks(*span, most=6):
        x = _MARGIN + (value - span[0]) / (span[1] - span[0]) * (WIDTH - 2 * _MARGIN)
        svg.line((x, 11.0, x, 16.0), Colour.SOFT)
        svg.text(x, 9.0, f"{value:g}".replace("-", "\N{MINUS SIGN}"), "middle")
    return svg.rendered(unit)


def course(athlete: Athlete, days: float, span: tuple[float, float], link: Link, words: str) -> str:
    """The development of an athlete: jumps over the days, the mean of each day, and a band of twice its deviation."""
    svg = Svg(_ROW)

    def at(day: float, value: float) -> tuple[float, float]:
        x = _MARGIN + day / max(days, 1.0) * (WIDTH - 2 * _MARGIN)
        return x, _ROW - 3 - (value - span[0]) / (span[1] - span[0]) * (_ROW - 6)

    dots = athlete.dots
    pooled = athlete.group.scatter
    each = np.unique(dots.days)
    means = np.array([dots.values[dots.days == day].mean() for day in each])
    if pooled is not None and len(each) > 1:
        counts = np.array([np.count_nonzero(dots.days == day) for day in each])
        half = 2 * pooled / np.sqrt(counts)
        low, high = np.clip(means - half, *span), np.clip(means + half, *span)
        there = [at(day, value) for day, value in zip(each, low, strict=True)]
        svg.area([*there, *reversed([at(day, value) for day, value in zip(each, high, strict=True)])], Colour.BLUE)
    for index, (day, value) in enumerate(zip(dots.days.tolist(), dots.values.tolist(), strict=True)):
        svg.linked_dot(*at(day, value), Colour.BLUE, link(dots.reports[index]), f"{dots.words[index]}: {value:.4g}")
    svg.path([at(day, value) for day, value in zip(each, means, strict=True)], Colour.INK)
    return svg.rendered(words)


def hill_chart(hills: dict[str, Means], between: str, unit: str, words: str) -> str:
    """Means of the days of each hill, with bands of twice their standard deviations."""
    values = np.concatenate([means.values for means in hills.values()])
    last = max(float(means.days.max()) for means in hills.values())
    chart = _over_days(between, last, span_of(values), unit)
    for colour, (hill, means) in zip(_COLOURS, hills.items(), strict=False):
        known = np.isfinite(means.sigmas)
        half = 2 * means.sigmas[known]
        low, high = means.values[known] - half, means.values[known] + half
        chart.band(means.days[known], np.clip(low, *span_of(values)), np.clip(high, *span_of(values)), colour)
        chart.curve(means.days, means.values, colour)
        chart.dots(means.days, means.values, colour)
        chart.legend(colour, hill)
    return chart.svg.rendered(words)


def drift_chart(drift: Drift, between: str, words: str) -> str:
    """Where a camera stood, day by day: X, Y and Z from their median, with twice their standard deviations."""
    reach = float(np.abs(drift.away_mm).max() + 2 * drift.sigma_mm.max())
    chart = _over_days(between, float(drift.days.max()), (-reach, reach), "mm")
    chart.rule(0.0, Colour.SOFT)
    for axis, colour in zip(range(3), _COLOURS, strict=False):
        away, half = drift.away_mm[:, axis], 2 * drift.sigma_mm[:, axis]
        chart.band(drift.days, away - half, away + half, colour)
        chart.curve(drift.days, away, colour)
        chart.dots(drift.days, away, colour)
        chart.legend(colour, "XYZ"[axis])
    return chart.svg.rendered(words)


def _over_days(between: str, last: float, span: tuple[float, float], unit: str) -> Chart:
    return Chart((-0.02 * (last + 1), 1.02 * (last + 1)), span, between, unit)
