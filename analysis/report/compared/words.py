# ruff: noqa: E501 - a text stands beside its translation
"""What the page of a comparison says, in English and Norwegian; a reader switches between them on the page."""

import re
from typing import Final

from analysis.comparison.report import WORDS
from analysis.report.language import LANGUAGES, Language, Said, shown

_NORWEGIAN: Final = {
    "alpha": "leggvinkel",
    "beta": "hoftevinkel",
    "gamma": "åpning av V-en",
    "dphi": "forskjell i skienes helning",
    "phi": "skienes helning",
    "angle_of_attack": "angrepsvinkel",
    "height": "høyde",
    "speed": "fart",
    "velocity_x": "fart langs X",
    "velocity_y": "fart langs Y",
    "velocity_z": "fart langs Z",
}
#: English and Norwegian, with `{name}` filled in.
TEXTS: Final = {
    "title": ("Two jumps compared", "To hopp sammenlignet"),
    "language": ("Language", "Språk"),
    "jump": ("jump {number}", "hopp {number}"),
    "unnamed": ("No name{bib}", "Uten navn{bib}"),
    "when": ("{day}, {time} {jump}", "{day}, {time} {jump}"),
    "different": ("What differs", "Hva som er ulikt"),
    "same": ("No difference found", "Ingen forskjell funnet"),
    "more": ("{quantity}: {size} more in B, {when}", "{quantity}: {size} mer i B, {when}"),
    "less": ("{quantity}: {size} less in B, {when}", "{quantity}: {size} mindre i B, {when}"),
    "after": ("{at} s after the take-off", "{at} s etter satsen"),
    "before": ("{at} s before the take-off", "{at} s før satsen"),
    "own": ("; two of the athlete's own jumps differ as much with {p}", "; to av utøverens egne hopp er så ulike med {p}"),
    "found_how": (
        "Where it differs most, with its standard deviation. More than errors of measurement make of equal jumps in 1 of 20 cases.",
        "Der forskjellen er størst, med standardavvik. Mer enn målefeil gjør av like hopp i 1 av 20 tilfeller.",
    ),
    "same_how": (
        "Errors of measurement alone may have made all of what differs. How large a change would have been found is said below.",
        "Målefeil alene kan ha gjort alt som er ulikt. Hvor stor endring som ville vært funnet, står lenger ned.",
    ),
    "no_scatter": (
        "How much the athlete's own jumps differ from each other is not known here.",
        "Hvor mye utøverens egne hopp skiller seg fra hverandre, er ikke kjent her.",
    ),
    "scatter": (
        "How much jumps of one athlete differ from each other is known from {jumps} further jumps.",
        "Hvor mye hopp av én utøver skiller seg fra hverandre, er kjent fra {jumps} andre hopp.",
    ),
    "places": ("At the same places", "På samme sted"),
    "place": ("{metres} m", "{metres} m"),
    "edge": ("edge", "kant"),
    "over": ("A and B", "A og B"),
    "over_how": (
        "Distances from the take-off. The stick figures are seen from the side, each by its own height above the take-off.",
        "Avstander fra satsen. Strekfigurene er sett fra siden, hver i sin egen høyde over satsen.",
    ),
    "no_pictures": ("The recordings are not beside the results, so there are no pictures.", "Opptakene ligger ikke ved resultatene, så det er ingen bilder."),
    "curves": ("All curves", "Alle kurver"),
    "numbers": ("Numbers", "Tall"),
    "method": ("How it was judged", "Hvordan det er bedømt"),
    "instants": (
        "B minus A with standard deviations; * where the greatest of all differences would be as large by chance in less than 1 of 20 comparisons of equal jumps. Times count from the take-off.",
        "B minus A med standardavvik; * der den største av alle forskjeller ville vært så stor ved tilfeldighet i færre enn 1 av 20 sammenligninger av like hopp. Tider regnes fra satsen.",
    ),
    "own_scatter": ("Standard deviation of one of the athlete's own jumps:", "Standardavvik for ett av utøverens egne hopp:"),
    "power": ("A change that lasts over the flight would have been found:", "En endring som varer hele svevet, ville vært funnet:"),
    "quantity": ("quantity", "størrelse"),
    "such": ("such a change", "en slik endring"),
    "this": ("and this one", "og denne"),
    "chance": ("{change} {unit} in {percent}", "{change} {unit} i {percent}"),
    "nearly": ("more than 99 %", "mer enn 99 %"),
    "greatest_of": (
        "The greatest of {count} differences is judged as the greatest of {independent} independent ones: its limit is {limit} times the standard deviation of repeated measurements.",
        "Den største av {count} forskjeller bedømmes som den største av {independent} uavhengige: grensen er {limit} ganger standardavviket for gjentatte målinger.",
    ),
    "calibration": ("Both jumps have the same calibration: its errors cancel.", "Begge hopp har samme kalibrering: feilene i den faller bort."),
    "survey": ("Both recordings were oriented with the same survey: its errors cancel.", "Begge opptak er orientert med samme innmåling: feilene i den faller bort."),
    "nothing": ("The jumps have different calibrations: the errors of both count.", "Hoppene har ulike kalibreringer: feilene i begge teller med."),
    "two_places": (
        "The take-offs are not at one place, so each jump has its own: do both recordings show one hill?",
        "Satsene er ikke på samme sted, så hvert hopp har sin egen: viser begge opptak samme bakke?",
    ),
    "seconds": ("s since take-off", "s siden satsen"),
    "minus": ("B minus A ({unit})", "B minus A ({unit})"),
    "line": ("difference", "forskjell"),
    "limit": ("limit", "grense"),
    "own_line": ("own scatter, 2 sigma", "egen spredning, 2 sigma"),
    "red": ("different", "ulikt"),
    "chart": ("{quantity} ({symbol}), B minus A.", "{quantity} ({symbol}), B minus A."),
    "large": ("The athlete's own scatter is larger than the chart.", "Utøverens egen spredning er større enn figuren."),
    "values": ("{quantity} ({symbol}) of both jumps.", "{quantity} ({symbol}) i begge hopp."),
}  # fmt: skip


def said(key: str, **values: object) -> Said:
    """A text with its values, of which a `Said` stands in each language's text as it is said there."""
    return Said(*(TEXTS[key][place].format(**_in(language, values)) for place, language in enumerate(LANGUAGES)))


def figure(written: str) -> Said:
    """A number, or several: a Norwegian one has a comma before its decimals."""
    return Said(written, re.sub(r"(?<=\d)\.(?=\d)", ",", written))


def quantity(name: str) -> Said:
    """The name of a quantity."""
    return Said(WORDS[name][0], _NORWEGIAN[name])


def text(key: str, tag: str = "span", **values: object) -> str:
    """A text as an element in each language."""
    return shown(said(key, **values), tag)


def first_letter_large(words: Said) -> Said:
    """The text with its first letter as a capital."""
    return Said(*(each[0].upper() + each[1:] for each in words))


def _in(language: Language, values: dict[str, object]) -> dict[str, object]:
    return {name: value.of(language) if isinstance(value, Said) else value for name, value in values.items()}
