"""The page as HTML: what to look at first, athletes, hills, cameras; it runs no script and loads nothing."""

import os
from functools import partial
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Final
from urllib.parse import quote

import numpy as np

from analysis.comparison.report import WORDS
from analysis.report.compared.words import figure, first_letter_large, quantity
from analysis.report.figures import decimals, fixed, plus_minus
from analysis.report.language import LANGUAGES, Said, same, shown
from analysis.report.still_page import still_page
from analysis.result.model import Quantity as Number
from rig.errors import StorageError
from rig.host.disk import replace_file
from season.page.content import Athlete, Content, Quantity, ToLookAt, content_of
from season.page.drawings import Link, course, drift_chart, hill_chart, scale, span_of, strip
from season.page.words import counted, said, text
from season.running.stores import is_remote
from season.tables.database import opened

NAME: Final = "season.html"
_LANGUAGE_NAMES: Final = {"en": "English", "nb": "Norsk"}


def write_page(out: Path) -> Path:
    """Write the page of a campaign beside its tables.

    Args:
        out: folder of the campaign.

    Returns:
        The page.

    Raises:
        BadInputError: there are no tables.
        StorageError: the disk refuses.
    """
    with opened(out) as database:
        content = content_of(database)
    page = out / NAME
    try:
        replace_file(page, season_page(content, partial(_link, out)).encode(), links=False)
    except OSError as error:
        raise StorageError(f"{page}: cannot be written ({error.strerror}); choose another folder") from error
    return page


def season_page(content: Content, link: Link) -> str:
    """The page.

    Args:
        content: what it shows.
        link: the address on the page of a report.
    """
    parts = [_head(content), "<main>"]
    parts.append(_list("look", content.look, content.counts["look"], link, folded=False))
    if content.first is None:
        parts.append(text("nothing", "p"))
    else:
        days = float(content.counts["days"] - 1)
        parts += [_quantity(each, content, days, link, opened=not at) for at, each in enumerate(content.quantities)]
        parts.append(_cameras(content))
    parts.append(_list("failed", content.passed_over, content.counts["failed"], link, folded=True))
    return _whole(content.campaign, "\n".join([*filter(None, parts), "</main>"]))


def _link(out: Path, report: str) -> str:
    return report if is_remote(report) else quote(os.path.relpath(report, out))


def _head(content: Content) -> str:
    choices = "".join(
        f'<label><input type="radio" name="language" id="in-{each}"{" checked" if each == "en" else ""}>'
        f"{_LANGUAGE_NAMES[each]}</label>"
        for each in LANGUAGES
    )
    switch = f'<fieldset><legend class="unseen">{text("language")}</legend>{choices}</fieldset>'
    of = {"jumps": "jumps", "athletes": "athletes", "hills": "hills_counted", "days": "days"}
    counts = {name: counted(key, content.counts[name]) for name, key in of.items()}
    between = "" if content.first is None else text("between", "p", first=content.first, last=content.last)
    return (
        f"<header><div><h1>{escape(content.campaign)}</h1>{switch}</div>"
        f"{text('counts', 'p', **counts)}{between}</header>"
    )


def _list(key: str, entries: list[ToLookAt], count: int, link: Link, *, folded: bool) -> str:
    if not entries:
        return ""
    rows = []
    for each in entries:
        who = shown(same(each.who)) if each.who else text("unnamed")
        when = "" if each.when is None else f"{each.when:%Y-%m-%d %H:%M} · "
        words = f"<b>{who}</b> <small>{when}{escape(each.hill)}</small> <span>{escape(each.why)}</span>"
        words = f'<a href="{escape(link(each.report))}">{words}</a>' if each.report else words
        rows.append(f"<li>{words}</li>")
    more = text("more", "p", count=count - len(entries), ask=key) if count > len(entries) else ""
    how = text("look_how", "p") if key == "look" else ""
    body = f'{how}<ul class="{key}">{"".join(rows)}</ul>{more}'
    if folded:
        return f"<details><summary>{text(key, count=count)}</summary>{body}</details>"
    return f"<section>{text(key, 'h2', count=count)}{body}</section>"


def _quantity(shown_one: Quantity, content: Content, days: float, link: Link, *, opened: bool) -> str:
    name, unit = quantity(shown_one.name), WORDS[shown_one.name][2]
    key = "quantity" if shown_one.distance_m else "takeoff"
    title = first_letter_large(said(key, quantity=name, distance=shown_one.distance_m))
    span = span_of(np.concatenate([athlete.dots.values for athlete in shown_one.athletes]))
    rows = [_athlete(athlete, name, unit, span, days, link) for athlete in shown_one.athletes]
    drawing = hill_chart(shown_one.hills, content.between, unit, said("hills").english)
    chart = f"<figure>{drawing}{text('hills', 'figcaption')}</figure>"
    above = f'<div class="row above"><span></span>{scale(span, said("scale", unit=unit).english)}<span></span></div>'
    return (
        f"<details{' open' if opened else ''}><summary>{shown(title)}</summary>{text('athletes_how', 'p')}"
        f"{text('stars_how', 'p')}{above}{''.join(rows)}{chart}</details>"
    )


def _athlete(athlete: Athlete, name: Said, unit: str, span: tuple[float, float], days: float, link: Link) -> str:
    group, who = athlete.group, athlete.group.of["athlete"] or ""
    star = ' <b class="star">*</b>' if group.differs else ""
    mean = plus_minus(Number(group.mean, group.sigma_mean), unit)
    if group.difference is None or group.sigma_difference is None or group.p is None:
        compared = text("no_test", "small")
    else:
        difference = fixed(group.difference, decimals(group.sigma_difference))
        difference = difference if group.difference < 0 else f"+{difference}"
        p = "< 0.001" if group.p < 1e-3 else f"= {group.p:.3f}"
        compared = text(
            "from_others", "small", difference=figure(difference), unit=unit if unit == "°" else f" {unit}", p=figure(p)
        )
    of = {"athlete": who, "quantity": name, "unit": unit}
    return (
        f'<div class="row"><div><strong>{escape(who)}{star}</strong> <span class="number">{shown(figure(mean))}</span> '
        f"{shown(counted('jumps', group.jumps), 'small')} {compared}</div>"
        f"{strip(athlete, span, link, said('strip', **of).english)}"
        f"{course(athlete, days, span, link, said('course', **of).english)}</div>"
    )


def _cameras(content: Content) -> str:
    if not content.drifts:
        return ""
    figures = []
    for drift in content.drifts:
        words = said("camera", hill=drift.hill, camera=drift.camera)
        drawing = drift_chart(drift, content.between, words.english)
        figures.append(f"<figure>{drawing}{shown(words, 'figcaption')}</figure>")
    charts = f'<div class="charts">{"".join(figures)}</div>'
    return f"<details><summary>{text('cameras')}</summary>{text('cameras_how', 'p')}{charts}</details>"


def _whole(title: str, body: str) -> str:
    style = files("season.page").joinpath("season.css").read_text(encoding="utf-8")
    return still_page(title, body, style)
