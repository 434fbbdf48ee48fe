"""The page of a comparison: needs no other file, runs no script, and has all words in both languages."""

from datetime import UTC, datetime
from importlib.resources import files
from typing import Final

import numpy as np

from analysis.comparison.aligned import MeasuredJump
from analysis.comparison.difference import LEVEL, Difference, Power
from analysis.comparison.report import WORDS, Comparison, in_words, instants, plain, plus_minus, signed
from analysis.comparison.shared_calibration import Common
from analysis.report.compared.charts import difference_chart, value_chart
from analysis.report.compared.places import Images, at_places
from analysis.report.compared.words import figure, first_letter_large, quantity, said, text
from analysis.report.course import course_of
from analysis.report.figures import plus_minus as with_sigma
from analysis.report.language import LANGUAGES, Language, Said, day_of, same, shown
from analysis.report.still_page import still_page
from analysis.result.model import QUANTITIES, Quantity
from rig.clocks import NS_PER_S

#: So many charts of what differs are shown at once; the others are unfolded.
_SHOWN: Final = 2
#: As much is said to be more than 99 %.
_NEARLY_ALL: Final = 0.995
_COMMON: Final = {Common.CALIBRATION: "calibration", Common.SURVEY: "survey", Common.NOTHING: "nothing"}
_NAMES: Final[dict[Language, str]] = {"en": "English", "nb": "Norsk"}


def comparison_page(
    comparison: Comparison, images: tuple[Images | None, Images | None], language: Language = "en"
) -> str:
    """The page as HTML.

    Args:
        comparison: two jumps.
        images: of both; None where they are not there.
        language: that is shown until a reader chooses the other one.

    Raises:
        BadInputError: a log cannot be read.
    """
    jumps = comparison.a, comparison.b
    courses = tuple(course_of(jump.jump, jump.recording.rate_hz) for jump in jumps)
    found = comparison.difference.found()
    known = sorted(
        (name for name in QUANTITIES if _known(comparison.difference, name)), key=lambda name: name not in found
    )
    folded = [difference_chart(comparison, name) for name in known if name not in found[:_SHOWN]]
    folded += [value_chart(comparison, name) for name in known]
    places = at_places(courses, [jump.jump.number for jump in jumps], images)
    body = [
        _head(jumps, language),
        "<main>",
        _verdict(comparison, found),
        _section("places", places + text("over_how", "p")),
        _charts([difference_chart(comparison, name) for name in found[:_SHOWN]]),
        _folded("curves", _charts(folded)),
        _folded("numbers", _numbers(comparison)),
        _folded("method", _method(comparison)),
        "</main>",
    ]
    title = " / ".join(_who(jump).of(language) for jump in jumps)
    return _whole(title, "\n".join(filter(None, body)), language)


def _known(d: Difference, name: str) -> bool:
    return bool(np.isfinite(d.value[QUANTITIES.index(name)]).any())


def _whole(title: str, body: str, language: Language) -> str:
    style = files("analysis.report.compared").joinpath("compared.css").read_text(encoding="utf-8")
    return still_page(title, body, style, language=language, images=True)


def _head(jumps: tuple[MeasuredJump, MeasuredJump], language: Language) -> str:
    choices = "".join(
        f'<label><input type="radio" name="language" id="in-{each}"{" checked" if each == language else ""}>'
        f"{_NAMES[each]}</label>"
        for each in LANGUAGES
    )
    rows = "".join(_heading(letter, jump) for letter, jump in zip("AB", jumps, strict=True))
    switch = f'<fieldset><legend class="unseen">{text("language")}</legend>{choices}</fieldset>'
    return f'<header><div>{text("title", "h1")}{switch}</div><ul class="jumps">{rows}</ul></header>'


def _heading(letter: str, jump: MeasuredJump) -> str:
    return f'<li class="{letter.lower()}"><b>{letter}</b> {shown(_who(jump))} {shown(_when(jump), "small")}</li>'


def _who(jump: MeasuredJump) -> Said:
    """Name and bib."""
    bib = jump.recording.session.get("bib", "").strip()
    name = jump.athlete.strip()
    return same(f"{name} ({bib})" if bib else name) if name else said("unnamed", bib=f" ({bib})" if bib else "")


def _when(jump: MeasuredJump) -> Said:
    """Date and time of the take-off here, and which jump of its recording it is, if there are several."""
    takeoff = jump.jump.takeoff
    if takeoff is None:
        return same("")
    then = datetime.fromtimestamp(takeoff.time / NS_PER_S, UTC).astimezone()
    when = day_of(then)
    several = len(jump.recording.jumps) > 1
    return said("when", day=when, time=f"{then:%H:%M}", jump=said("jump", number=jump.jump.number) if several else "")


def _section(key: str, content: str) -> str:
    return f"<section>{text(key, 'h2')}{content}</section>"


def _folded(key: str, content: str) -> str:
    return f"<details><summary>{text(key)}</summary>{content}</details>"


def _charts(figures: list[str]) -> str:
    return f'<div class="charts">{"".join(figures)}</div>' if figures else ""


def _verdict(comparison: Comparison, found: list[str]) -> str:
    scatter = comparison.scatter
    own = text("no_scatter", "p") if scatter is None else text("scatter", "p", jumps=scatter.jumps)
    if not found:
        return _section("same", text("same_how", "p") + own)
    lines = "".join(f"<li>{shown(_greatest(comparison, name))}</li>" for name in found)
    return _section("different", f'<ul class="found">{lines}</ul>{text("found_how", "p")}{own}')


def _greatest(comparison: Comparison, name: str) -> Said:
    d, row = comparison.difference, QUANTITIES.index(name)
    at = d.greatest(row)
    if at is None:
        return same("")
    value, since = float(d.value[row, at]), float(d.times[at])
    when = said("before" if since < 0 else "after", at=figure(f"{abs(since):.2f}"))
    size = figure(with_sigma(Quantity(abs(value), float(d.sigma[row, at])), WORDS[name][2]))
    words = said("less" if value < 0 else "more", quantity=quantity(name), size=size, when=when)
    scatter = comparison.scatter
    if scatter is not None and np.isfinite(scatter.deviation[row, at]):
        own = said("own", p=figure(in_words(float(scatter.p(d.value)[row, at]))))
        words = Said(*(one + other for one, other in zip(words, own, strict=True)))
    return first_letter_large(words)


def _table(head: list[str], rows: list[list[str]]) -> str:
    """A table of elements; the first of each row is its heading."""
    lines = ["".join(f"<th>{cell}</th>" if cell else "<td></td>" for cell in head)]
    lines += [f"<th>{row[0]}</th>" + "".join(f"<td>{cell}</td>" for cell in row[1:]) for row in rows]
    return f'<div class="table" tabindex="0"><table>{"".join(f"<tr>{line}</tr>" for line in lines)}</table></div>'


def _numbers(comparison: Comparison) -> str:
    d, own = comparison.difference, comparison.scatter
    times = instants(d.times)
    head = ["", *(_number(f"{signed(d.times[at], 2)} s") for at in times)]
    names = [f"{_named(name)} ({WORDS[name][2]})" for name in QUANTITIES]
    rows = [[names[row], *(_number(_cell(d, name, row, at)) for at in times)] for row, name in enumerate(QUANTITIES)]
    parts = [text("instants", "p"), _table(head, rows)]
    if own is not None:
        deviations = [
            [names[row], *(_number(plain(own.deviation[row, at], WORDS[name][3] + 1)) for at in times)]
            for row, name in enumerate(QUANTITIES)
        ]
        parts += [text("own_scatter", "p"), _table(head, deviations)]
    powers = [_power_row(name, power) for name, power in d.power.items() if power is not None]
    if powers:
        parts += [text("power", "p"), _table([text("quantity"), text("such"), text("this")], powers)]
    return "".join(parts)


def _named(name: str) -> str:
    return shown(quantity(name))


def _number(number: str) -> str:
    return shown(figure(number))


def _power_row(name: str, power: Power) -> list[str]:
    _, _, unit, decimals = WORDS[name]
    percent = said("nearly") if power.probability >= _NEARLY_ALL else f"{100 * power.probability:.0f} %"
    found = figure(f"{power.change_80:.{decimals + 1}f}")
    return [
        _named(name),
        text("chance", change=figure(f"{power.change:g}"), unit=unit, percent=percent),
        text("chance", change=found, unit=unit, percent="80 %"),
    ]


def _cell(d: Difference, name: str, row: int, at: int) -> str:
    if not np.isfinite(d.value[row, at]):
        return ""
    return plus_minus(name, d.value[row, at], d.sigma[row, at]) + ("*" if d.p_greatest[row, at] < LEVEL else "")


def _method(comparison: Comparison) -> str:
    d = comparison.difference
    count = int(np.isfinite(d.value).sum())
    lines = [
        text("greatest_of", "p", count=count, independent=f"{d.independent:.0f}", limit=figure(f"{d.limit:.1f}")),
        text(_COMMON[d.common], "p"),
        "" if comparison.alignment.at_one_place else text("two_places", "p"),
    ]
    return "".join(lines)
