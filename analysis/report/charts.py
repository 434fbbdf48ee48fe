"""Charts of a jump: bands over the distance, and the stick model from the side and from above (Fig. 8)."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.report.course import Course, Series, best_state
from analysis.report.figures import fixed
from analysis.report.language import Language, Said, with_comma
from analysis.report.overlay import stick_lines
from photogrammetry.reports.document import Drawing
from photogrammetry.reports.drawing.svg import Colour
from photogrammetry.reports.drawing.to_scale import Canvas, Chart
from rig.arrays import Flags, Floats

#: Half the width of a band, in standard deviations.
BAND_SIGMAS = 2.0
_FIG8_POSITIONS = 5
_WHOLE = 4  # lines of a stick model: body, feet, two skis
_WIDE_SIGMAS = 4.0  # times the median sigma: bands wider than that may be cut off
_ROOM = 0.06  # of the values' range, above and below


@dataclass(frozen=True, slots=True)
class Graph:
    """What one chart shows.

    Attributes:
        name: of the quantity.
        symbol: at its axis.
        title: for people.
        title_nb, symbol_nb: both in Norwegian.
        unit: of the values.
        least: the smallest range of values, so that noise does not look like motion.
    """

    name: str
    symbol: str
    title: str
    unit: str
    least: float
    title_nb: str
    symbol_nb: str

    @property
    def titles(self) -> Said:
        """In both languages."""
        return Said(self.title, self.title_nb)

    @property
    def symbols(self) -> Said:
        """In both languages."""
        return Said(self.symbol, self.symbol_nb)


GRAPHS = (
    Graph(
        "alpha",
        "alpha",
        "Ski-to-body angle (skis to legs)",
        "°",
        10.0,
        "Vinkel mellom ski og kropp (ski mot legger)",
        "alfa",
    ),
    Graph("beta", "beta", "Hip angle (180° is straight)", "°", 10.0, "Hoftevinkel (180° er rett)", "beta"),
    Graph(
        "angle_of_attack",
        "angle of attack",
        "Angle of attack of the skis (no wind assumed)",
        "°",
        10.0,
        "Skienes angrepsvinkel (uten vind)",
        "angrepsvinkel",
    ),
    Graph(
        "phi",
        "phi",
        "Slope of the skis (tips up is positive)",
        "°",
        10.0,
        "Skienes helning (tuppene opp er positivt)",
        "phi",
    ),
    Graph("gamma", "gamma", "V angle between the skis", "°", 5.0, "V-vinkelen mellom skiene", "gamma"),
    Graph(
        "dphi",
        "delta-phi",
        "Slope of the right ski minus the left",
        "°",
        5.0,
        "Høyre skis helning minus venstre skis",
        "delta-phi",
    ),
    Graph(
        "height",
        "Z0",
        "Height of the bindings (survey's zero)",
        "m",
        0.5,
        "Bindingenes høyde (fra innmålingens null)",
        "Z0",
    ),
    Graph("speed", "v", "Speed of the bindings", "m/s", 1.0, "Bindingenes fart", "v"),
)


def bands(course: Course, language: Language) -> list[Drawing]:
    """A chart of each quantity over the distance; none of a quantity that was never found."""
    found = [(graph, _band(course, graph, language)) for graph in GRAPHS]
    return [Drawing(graph.titles.of(language), svg) for graph, svg in found if svg]


def cursor_places(course: Course) -> list[float | None]:
    """Where each pulse stands in every chart, page units; None where its distance is not known."""
    limits = _limits(course)
    if limits is None:
        return [None] * len(course.pulses)
    chart = Chart(limits, (0.0, 1.0), "", "")
    return [round(chart.x(d), 1) if np.isfinite(d) else None for d in course.distance]


def fig8(course: Course, language: Language) -> list[Drawing]:
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
    at = Said("at", "ved").of(language)
    speeds = [f"{fixed(float(speed[i]), 1)} m/s {at} {_when(course, i)}" for i in shown if np.isfinite(speed[i])]
    side = Said("From the side; right ski amber, left ski blue.", "Fra siden; høyre ski oransje, venstre ski blå.")
    above = " ".join(
        (Said("From above.", "Ovenfra.").of(language), *_sentence(Said("Speed", "Fart").of(language), speeds))
    )
    return [
        _projected(course, sticks, (0, 2), Said("up", "opp"), side.of(language), language),
        _projected(course, sticks, (0, 1), Said("left", "venstre"), above, language),
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


def _band(course: Course, graph: Graph, language: Language) -> str:
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
    chart = Chart(limits, (bottom, top), _x_label(course).of(language), f"{graph.symbols.of(language)} ({graph.unit})")
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
    over = Said("over the distance", "over avstanden").of(language)
    return _in_language(chart.svg.rendered(f"{graph.titles.of(language)}, {graph.unit}, {over}"), language)


def _in_language(svg: str, language: Language) -> str:
    return with_comma(svg) if language == "nb" else svg


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


def _x_label(course: Course) -> Said:
    if course.takeoff_sigma_s is None:
        return Said("distance from the first pulse (m)", "avstand fra den første pulsen (m)")
    return Said("distance from the take-off (m)", "avstand fra satsen (m)")


def _range(value: Floats, sigma: Floats, least: float) -> tuple[float, float]:
    """Limits of the values' axis; a few wide bands are cut off rather than flatten the curve."""
    half = BAND_SIGMAS * np.minimum(sigma, _WIDE_SIGMAS * np.median(sigma))
    bottom, top = float((value - half).min()), float((value + half).max())
    room = max(_ROOM * (top - bottom), (least - (top - bottom)) / 2)
    return bottom - room, top + room


def _projected(
    course: Course,
    sticks: dict[int, dict[str, Floats]],
    columns: tuple[int, int],
    up: Said,
    caption: str,
    language: Language,
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
    canvas.axes(Said("along the flight", "langs svevet").of(language), up.of(language))
    if language == "nb":
        caption = re.sub(r"(?<=\d)\.(?=\d)", ",", caption)
    return Drawing(caption, _in_language(canvas.svg.rendered(caption), language))
