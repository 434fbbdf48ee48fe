"""A comparison for people and programs: lines for the terminal, a page with drawings, and JSON."""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from analysis.comparison.aligned import MeasuredJump
from analysis.comparison.alignment import Alignment
from analysis.comparison.difference import LEVEL, Difference, Power
from analysis.comparison.scatter import Scatter
from analysis.comparison.shared_calibration import Common
from analysis.result.model import QUANTITIES
from photogrammetry.reports.document import Drawing, Report, Section, Table
from photogrammetry.reports.drawing.svg import Colour
from photogrammetry.reports.drawing.to_scale import Chart, rounded_up
from rig.arrays import Floats

FORMAT: Final = "svev-comparison/1"
#: Instants of the tables, s since the take-off.
INSTANTS: Final = (-0.1, 0.0, 0.1, 0.2, 0.3, 0.5, 0.7)
#: In words, symbol, unit, decimals.
WORDS: Final = {
    "alpha": ("leg angle", "alpha", "°", 1),
    "beta": ("hip angle", "beta", "°", 1),
    "gamma": ("opening of the V", "gamma", "°", 1),
    "dphi": ("difference of the skis' slopes", "dphi", "°", 1),
    "phi": ("slope of the skis", "phi", "°", 1),
    "angle_of_attack": ("angle of attack", "attack", "°", 1),
    "height": ("height", "Z0", "m", 3),
    "speed": ("speed", "v", "m/s", 2),
    "velocity_x": ("velocity along X", "vX", "m/s", 2),
    "velocity_y": ("velocity along Y", "vY", "m/s", 2),
    "velocity_z": ("velocity along Z", "vZ", "m/s", 2),
}
_CALIBRATION: Final = {
    Common.CALIBRATION: "both jumps have the same calibration: its errors cancel",
    Common.SURVEY: "both recordings were oriented with the same survey: its errors cancel",
    Common.NOTHING: "the jumps have different calibrations: the errors of both count",
}
#: The athlete's own scatter is left out of a chart that it would make so many times higher.
_MOST_SCATTER: Final = 3.0
_LEGEND: Final = (
    (Colour.BLUE, "difference"),
    (Colour.SOFT, "limit"),
    (Colour.AMBER, "own scatter, 2 sigma"),
    (Colour.RED, "different"),
)


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Two jumps and what was found.

    Attributes:
        alignment: of all jumps; the first two are compared.
        difference: B minus A.
        scatter: the athlete's own; None if not known.
    """

    alignment: Alignment
    difference: Difference
    scatter: Scatter | None

    @property
    def a(self) -> MeasuredJump:
        """The one jump."""
        return self.alignment.jumps[0]

    @property
    def b(self) -> MeasuredJump:
        """The other."""
        return self.alignment.jumps[1]


def summary(comparison: Comparison) -> list[str]:
    """Lines for the terminal: what differs, by how much, and what would have been found."""
    power = [(name, power) for name, power in comparison.difference.power.items() if power]
    return [
        *_verdict(comparison),
        "would have been found, if it lasted over the flight:",
        *(f"  {WORDS[name][0]}: {', '.join(_chances(name, each))}" for name, each in power),
    ]


def _verdict(comparison: Comparison) -> list[str]:
    d = comparison.difference
    found = d.found()
    lines = [f"A: {_title(comparison.a)}", f"B: {_title(comparison.b)}"]
    if found:
        lines.append(f"different at {100 * LEVEL:.0f} %, B minus A where it differs most:")
        lines += [f"  {_greatest(comparison, name)}" for name in found]
    else:
        lines.append(f"no difference found at {100 * LEVEL:.0f} %")
    lines.append(
        f"the greatest of {int(np.isfinite(d.value).sum())} differences is judged as the greatest of "
        f"{d.independent:.0f} independent ones: its limit is {d.limit:.1f} times the sigma of repeated measurements"
    )
    lines.append(_CALIBRATION[d.common])
    if not comparison.alignment.at_one_place:
        lines.append("the take-offs are not at one place, so each jump has its own: do both recordings show one hill?")
    if comparison.scatter is None:
        return [*lines, "the athlete's own scatter is not known: give further jumps of the athlete with --also"]
    return [*lines, f"the athlete's own scatter is that of {comparison.scatter.jumps} further jumps"]


def _title(jump: MeasuredJump) -> str:
    who = f", {jump.athlete}" if jump.athlete else ""
    return f"{jump.name}, jump {jump.jump.number}{who}"


def _greatest(comparison: Comparison, name: str) -> str:
    d, row = comparison.difference, QUANTITIES.index(name)
    at = d.greatest(row)
    words, _, unit, _ = WORDS[name]
    if at is None:
        return f"{words}: not known"
    return (
        f"{words}: {_pm(name, d.value[row, at], d.sigma[row, at])} {unit} at {_signed(d.times[at], 2)} s "
        f"({_p(d.p_greatest[row, at])}){_own(comparison, row, at)}"
    )


def _own(comparison: Comparison, row: int, at: int) -> str:
    d, scatter = comparison.difference, comparison.scatter
    if scatter is None or not np.isfinite(scatter.deviation[row, at]):
        return ""
    return f"; two of the athlete's own jumps differ as much with {_p(float(scatter.p(d.value)[row, at]))}"


def _chances(name: str, power: Power) -> tuple[str, str]:
    """How likely the usual change is found, and which change is found in 80 %."""
    _, _, unit, decimals = WORDS[name]
    percent = f"{100 * power.probability:.0f} %" if power.probability < 0.995 else "more than 99 %"
    return f"{power.change:g} {unit} in {percent}", f"{power.change_80:.{decimals + 1}f} {unit} in 80 %"


def report(comparison: Comparison) -> Report:
    """The page."""
    d = comparison.difference
    found = set(d.found())
    order = sorted(QUANTITIES, key=lambda name: name not in found)
    return Report(
        f"Comparison: {comparison.a.name} and {comparison.b.name}",
        (
            Section("Summary", tuple(line.strip() for line in _verdict(comparison))),
            Section("At instants", _instants(comparison)),
            Section("What would have been found", _powers(d)),
            Section("Differences", tuple(_difference_chart(comparison, name) for name in order if _known(d, name))),
            Section("Values", tuple(_value_chart(d, name) for name in order if _known(d, name))),
        ),
    )


def _known(d: Difference, name: str) -> bool:
    return bool(np.isfinite(d.value[QUANTITIES.index(name)]).any())


def _instants(comparison: Comparison) -> tuple[str | Table | Drawing, ...]:
    d, own = comparison.difference, comparison.scatter
    times = instants(d.times)
    marks = tuple(f"{_signed(d.times[at], 2)} s" for at in times)
    rows = tuple(
        (f"{WORDS[name][1]} ({WORDS[name][2]})", *(_cell(d, name, row, at) for at in times))
        for row, name in enumerate(QUANTITIES)
    )
    words = (
        "Differences with their standard deviations; * where the greatest of all differences would be as large "
        f"by chance in less than {100 * LEVEL:.0f} % of comparisons of equal jumps. Times count from the take-off."
    )
    table = Table(("B minus A", *marks), rows)
    if own is None:
        return (words, table)
    scatter = tuple(
        (row[0], *(_plain(own.deviation[index, at], WORDS[name][3] + 1) for at in times))
        for index, (name, row) in enumerate(zip(QUANTITIES, rows, strict=True))
    )
    return (words, table, "Standard deviation of one of the athlete's own jumps:", Table(("scatter", *marks), scatter))


def _powers(d: Difference) -> tuple[str | Table | Drawing, ...]:
    rows = tuple((WORDS[name][1], *_chances(name, power)) for name, power in d.power.items() if power)
    return ("A change that lasts over the flight is found:", Table(("quantity", "such a change", "and this one"), rows))


def _cell(d: Difference, name: str, row: int, at: int) -> str:
    if not np.isfinite(d.value[row, at]):
        return ""
    return _pm(name, d.value[row, at], d.sigma[row, at]) + ("*" if d.p_greatest[row, at] < LEVEL else "")


def instants(times: Floats) -> list[int]:
    """Indices of the times nearest to `INSTANTS`, as far as they are within the times."""
    step = float(times[1] - times[0])
    nearest = [(int(np.argmin(np.abs(times - instant))), instant) for instant in INSTANTS]
    return [at for at, instant in nearest if abs(times[at] - instant) <= step]


def _difference_chart(comparison: Comparison, name: str) -> Drawing:
    d, row = comparison.difference, QUANTITIES.index(name)
    words, symbol, unit, _ = WORDS[name]
    known = np.isfinite(d.value[row])
    times, value, limit = d.times[known], d.value[row, known], d.limit * d.repeat[row, known]
    least = float(np.concatenate((np.abs(value), limit)).max())
    own = _twice_scatter(comparison, row)[known]
    top = rounded_up(1.1 * max([least, *own[own < _MOST_SCATTER * least]]))
    chart = Chart((float(times[0]), float(times[-1])), (-top, top), "s since take-off", f"B minus A ({unit})")
    chart.rule(0.0, Colour.SOFT)
    drawn, different = own < top, d.p_greatest[row, known] < LEVEL
    for sign in (-1, 1):
        chart.curve(times, sign * limit, Colour.SOFT)
        chart.curve(times[drawn], sign * own[drawn], Colour.AMBER)
    chart.curve(times, value, Colour.BLUE)
    chart.dots(times[different], value[different], Colour.RED, 2.5)
    shown = (True, True, bool(drawn.any()), bool(different.any()))
    for colour, legend in (entry for entry, there in zip(_LEGEND, shown, strict=True) if there):
        chart.legend(colour, legend)
    large = bool((own >= top).any())
    caption = (
        f"{_capital(words)} ({symbol}), B minus A: {'different' if different.any() else 'no difference found'}"
        + ("; the athlete's own scatter is larger than the chart." if large else ".")
    )
    return Drawing(caption, chart.svg.rendered(caption))


def _twice_scatter(comparison: Comparison, row: int) -> Floats:
    """Twice the standard deviation (T,) of the difference of two of the athlete's own jumps; NaN if not known."""
    if comparison.scatter is None:
        return np.full(len(comparison.difference.times), np.nan)
    return np.asarray(2 * np.sqrt(2) * comparison.scatter.deviation[row])


def _value_chart(d: Difference, name: str) -> Drawing:
    row = QUANTITIES.index(name)
    words, symbol, unit, _ = WORDS[name]
    known = np.isfinite(d.value[row])
    times, a, b = d.times[known], d.a[row, known], d.b[row, known]
    low, high = float(min(a.min(), b.min())), float(max(a.max(), b.max()))
    room = max(0.05 * (high - low), 1e-6)
    chart = Chart((float(times[0]), float(times[-1])), (low - room, high + room), "s since take-off", unit)
    for values, colour, legend in ((a, Colour.AMBER, "A"), (b, Colour.BLUE, "B")):
        chart.curve(times, values, colour)
        chart.legend(colour, legend)
    caption = f"{_capital(words)} ({symbol}) of both jumps."
    return Drawing(caption, chart.svg.rendered(caption))


def to_json(comparison: Comparison) -> dict[str, Any]:
    """The content of `comparison.json`; null where something is not known."""
    d, own = comparison.difference, comparison.scatter
    quantities = {}
    for row, name in enumerate(QUANTITIES):
        power = d.power[name]
        quantities[name] = {
            "unit": WORDS[name][2].replace("°", "deg"),
            "different": name in d.found(),
            "greatest": _greatest_json(d, row),
            "power": None
            if power is None
            else {"change": power.change, "probability": power.probability, "change_80": power.change_80},
            "a": _list(d.a[row]),
            "b": _list(d.b[row]),
            "difference": _list(d.value[row]),
            "sigma": _list(d.sigma[row]),
            "sigma_repeat": _list(d.repeat[row]),
            "p": _list(d.p[row]),
            "p_greatest": _list(d.p_greatest[row]),
            "scatter": None if own is None else _list(own.deviation[row]),
            "p_scatter": None if own is None else _list(own.p(d.value)[row]),
        }
    return {
        "format": FORMAT,
        **{
            key: {
                "name": jump.name,
                "recording": jump.recording.recording,
                "jump": jump.jump.number,
                "session": dict(jump.recording.session),
            }
            for key, jump in (("a", comparison.a), ("b", comparison.b))
        },
        "level": LEVEL,
        "same_calibration": d.common is Common.CALIBRATION,
        "same_survey": d.common is not Common.NOTHING,
        "takeoffs_at_one_place": comparison.alignment.at_one_place,
        "independent_differences": d.independent,
        "limit": d.limit,
        "different": d.found(),
        "scatter": None if own is None else {"jumps": own.jumps, "degrees_of_freedom": own.freedom},
        "since_takeoff_s": _list(d.times),
        "quantities": quantities,
    }


def _greatest_json(d: Difference, row: int) -> dict[str, float] | None:
    at = d.greatest(row)
    if at is None:
        return None
    return {
        "since_takeoff_s": float(d.times[at]),
        "difference": float(d.value[row, at]),
        "sigma": float(d.sigma[row, at]),
        "p": float(d.p_greatest[row, at]),
    }


def _list(values: Floats) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]


def _pm(name: str, value: float, sigma: float) -> str:
    decimals = WORDS[name][3]
    return f"{_signed(value, decimals)} ± {sigma:.{decimals}f}"


def _signed(value: float, decimals: int) -> str:
    rounded = round(value, decimals)
    return f"{rounded:+.{decimals}f}".replace("-", "\N{MINUS SIGN}") if rounded else f"{0:.{decimals}f}"


def _plain(value: float, decimals: int) -> str:
    return f"{value:.{decimals}f}" if math.isfinite(value) else ""


def _p(p: float) -> str:
    return "p < 0.0001" if p < 1e-4 else f"p = {p:.2g}"


def _capital(words: str) -> str:
    return words[0].upper() + words[1:]
