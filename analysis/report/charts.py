"""Charts of a jump: bands over the distance, and the stick model from the side and from above (Fig. 8)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.report.course import Course, Series, best_state
from analysis.report.figures import fixed
from analysis.report.overlay import stick_lines
from photogrammetry.reports.document import Drawing
from photogrammetry.reports.drawing.svg import Colour
from photogrammetry.reports.drawing.to_scale import Canvas, Chart
from rig.arrays import Flags, Floats

#: Half the width of a band, in standard deviations.
BAND_SIGMAS = 2.0
_FIG8_POSITIONS = 5
_WHOLE = 4  # lines of a stick model: body, feet, two skis
_WIDE = 4.0  # times the median sigma: bands wider than that may be cut off
_ROOM = 0.06  # of the values' range, above and below


@dataclass(frozen=True, slots=True)
class Graph:
    """What one chart shows.

    Attributes:
        name: of the quantity.
        symbol: at its axis.
        title: for people.
        unit: of the values.
        least: the smallest range of values, so that noise does not look like motion.
    """

    name: str
    symbol: str
    title: str
    unit: str
    least: float


GRAPHS = (
    Graph("alpha", "alpha", "Ski-to-body angle (skis to legs)", "°", 10.0),
    Graph("beta", "beta", "Hip angle (180° is straight)", "°", 10.0),
    Graph("angle_of_attack", "angle of attack", "Angle of attack of the skis (no wind assumed)", "°", 10.0),
    Graph("phi", "phi", "Slope of the skis (tips up is positive)", "°", 10.0),
    Graph("gamma", "gamma", "V angle between the skis", "°", 5.0),
    Graph("dphi", "delta-phi", "Slope of the right ski minus the left", "°", 5.0),
    Graph("height", "Z0", "Height of the bindings (survey's zero)", "m", 0.5),
    Graph("speed", "v", "Speed of the bindings", "m/s", 1.0),
)


def bands(course: Course) -> list[Drawing]:
    """A chart of each quantity over the distance; none of a quantity that was never found."""
    found = [(graph, _band(course, graph)) for graph in GRAPHS]
    return [Drawing(graph.title, svg) for graph, svg in found if svg]


def cursor_places(course: Course) -> list[float | None]:
    """Where each pulse stands in every chart, page units; None where its distance is not known."""
    limits = _limits(course)
    if limits is None:
        return [None] * len(course.pulses)
    chart = Chart(limits, (0.0, 1.0), "", "")
    return [round(chart.x(d), 1) if np.isfinite(d) else None for d in course.distance]


def fig8(course: Course) -> list[Drawing]:
    """The stick model at evenly distributed pulses, projected on the vertical plane of the flight and from above."""
    shown = evenly(course, _FIG8_POSITIONS, range(len(course.pulses)))
    if not shown:
        return []
    sticks = {
        i: {
            part: (line - course.start) @ course.axes.T
            for part, line in stick_lines(best_state(course.pulses[i])).items()
        }
        for i in shown
    }
    speed = course.smoothed["speed"].value
    speeds = [f"{fixed(float(speed[i]), 1)} m/s at {_when(course, i)}" for i in shown if np.isfinite(speed[i])]
    return [
        _projected(course, sticks, (0, 2), "up", "From the side; right ski amber, left ski blue."),
        _projected(course, sticks, (0, 1), "left", " ".join(("From above.", *_sentence("Speed", speeds)))),
    ]


def evenly(course: Course, count: int, among: Sequence[int]) -> list[int]:
    """At most `count` of these pulses (indices) with a whole stick model, evenly distributed over the distance."""
    whole = [
        i for i in among if len(stick_lines(best_state(course.pulses[i]))) == _WHOLE and np.isfinite(course.distance[i])
    ]
    if not whole:
        return []
    places = np.linspace(course.distance[whole[0]], course.distance[whole[-1]], count)
    return sorted({whole[int(np.argmin(np.abs(course.distance[whole] - place)))] for place in places})


def _when(course: Course, i: int) -> str:
    return f"{fixed(float(course.since[i]), 2)} s"


def _sentence(subject: str, values: Sequence[str]) -> tuple[str, ...]:
    return (f"{subject} {', '.join(values)}.",) if values else ()


def _limits(course: Course) -> tuple[float, float] | None:
    finite = course.distance[np.isfinite(course.distance)]
    if len(finite) < 2 or np.ptp(finite) <= 0:
        return None
    return float(finite.min()), float(finite.max())


def _band(course: Course, graph: Graph) -> str:
    """A chart as SVG; empty if there is nothing to draw. Without a model over time, each pulse has its own bar."""
    limits, raw = _limits(course), course.raw[graph.name]
    series = course.smoothed[graph.name]
    there = np.isfinite(series.value + series.sigma + course.distance)
    if smooth := np.count_nonzero(there) > 1:
        bottom, top = _range(series.value[there], series.sigma[there], graph.least)
    else:
        there = np.isfinite(raw.value + raw.sigma + course.distance)
        if np.count_nonzero(there) < 2:
            return ""
        bottom, top = _range(raw.value[there], raw.sigma[there], graph.least)
    if limits is None:
        return ""
    chart = Chart(limits, (bottom, top), _x_label(course), f"{graph.symbol} ({graph.unit})")
    if limits[0] < 0 < limits[1]:
        chart.upright(0.0, Colour.SOFT)
    if smooth:
        _draw_band(chart, course, series, there, (bottom, top))
    else:
        for x, value, sigma in zip(course.distance[there], raw.value[there], raw.sigma[there], strict=True):
            low, high = np.clip((value - BAND_SIGMAS * sigma, value + BAND_SIGMAS * sigma), bottom, top)
            chart.spread(float(x), float(low), float(high), Colour.SOFT)
    with np.errstate(invalid="ignore"):
        inside = np.isfinite(course.distance) & (raw.value >= bottom) & (raw.value <= top)
    chart.dots(course.distance[inside], raw.value[inside], Colour.INK, 1.1)
    return chart.svg.rendered(f"{graph.title}, {graph.unit}, over the distance")


def _draw_band(chart: Chart, course: Course, series: Series, there: Flags, limits: tuple[float, float]) -> None:
    """The smoothed values with their band, cut off at the limits of the axis."""
    half = BAND_SIGMAS * series.sigma
    low, high = (np.clip(edge, *limits) for edge in (series.value - half, series.value + half))
    for run, unsure in _runs(there, course.unsure):
        colour = Colour.SOFT if unsure else Colour.BLUE
        chart.band(course.distance[run], low[run], high[run], colour)
        chart.curve(course.distance[run], series.value[run], colour)


def _runs(there: Flags, unsure: Flags) -> Iterator[tuple[slice, bool]]:
    """Successive pulses with values, cut where they become sure or unsure; a piece with an unsure end is unsure."""
    pieces = there[:-1] & there[1:]
    grey = unsure[:-1] | unsure[1:]
    first = 0
    for i in range(1, len(pieces) + 1):
        if i == len(pieces) or pieces[i] != pieces[first] or grey[i] != grey[first]:
            if pieces[first]:
                yield slice(first, i + 1), bool(grey[first])
            first = i


def _x_label(course: Course) -> str:
    return "distance from the " + ("first pulse" if course.takeoff_sigma_s is None else "take-off") + " (m)"


def _range(value: Floats, sigma: Floats, least: float) -> tuple[float, float]:
    """Limits of the values' axis; a few wide bands are cut off rather than flatten the curve."""
    half = BAND_SIGMAS * np.minimum(sigma, _WIDE * np.median(sigma))
    bottom, top = float((value - half).min()), float((value + half).max())
    room = max(_ROOM * (top - bottom), (least - (top - bottom)) / 2)
    return bottom - room, top + room


def _projected(
    course: Course, sticks: dict[int, dict[str, Floats]], columns: tuple[int, int], up: str, caption: str
) -> Drawing:
    """One projection; O's path behind it, and the time under each stick model."""
    pick = list(columns)
    origins = np.array(
        [
            np.full(3, np.nan) if pulse.smoothed is None else course.axes @ (pulse.smoothed.origin.value - course.start)
            for pulse in course.pulses
        ]
    )[:, pick]
    path = origins[np.isfinite(origins).all(axis=1)]
    lines = {i: {part: line[:, pick] for part, line in stick.items()} for i, stick in sticks.items()}
    canvas = Canvas(np.concatenate([path, *(line for stick in lines.values() for line in stick.values())]))
    canvas.svg.path((canvas.at(place) for place in path), Colour.FAINT)
    colours = {"right": Colour.AMBER, "left": Colour.BLUE}
    for i, stick in lines.items():
        for part, line in stick.items():
            canvas.svg.path((canvas.at(place) for place in line), colours.get(part, Colour.INK))
        if "body" in stick:
            x, y = canvas.at(stick["body"][0])
            canvas.svg.dot(x, y, Colour.INK, 2.4)
            canvas.svg.text(x, y - 6.0, _when(course, i), "middle")
    canvas.scale_bar("m")
    canvas.axes("along the flight", up)
    return Drawing(caption, canvas.svg.rendered(caption))
