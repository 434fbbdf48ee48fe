"""What is typed into a search field: free words, and conditions such as `alpha > 48`, `bib:17` or `date:2026-11-21`."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Final, TypeVar

from rig.api.athletes import folded
from rig.api.statement import Level
from rig.errors import BadInputError
from rig.phrase import phrase

#: Quantities of a jump, by the column in which they stand.
QUANTITIES: Final = {
    "alpha": "ski_to_body",
    "attack": "angle_of_attack",
    "speed": "speed_20_m",
    "takeoff": "takeoff_speed",
    "perpendicular": "perpendicular",
}
#: Fields of a recording that have a meaning of their own; every other name is that of a field of the session.
_FAVOURITE: Final = {"yes": True, "no": False}
_COMPARISONS: Final = {
    ">": ">",
    ">=": ">=",
    "<": "<",
    "<=": "<=",
    "above": ">",
    "over": ">",
    "below": "<",
    "under": "<",
}
_ORDERED: Final = (*QUANTITIES, "duration", "date")
#: `name > value`, `name above value` for what has an order; `name:value`, with a value in quotes where it has blanks.
_TERM: Final = re.compile(
    rf"(?P<ordered>{'|'.join(_ORDERED)})\s*(?P<sign>>=|<=|>|<|≥|≤|\s(?:above|over|below|under)(?!\S))\s*(?P<bound>\S*)"
    r"|(?P<name>[^\W\d][\w-]*)(?P<equal>[:=])(?P<value>\"[^\"]*\"|\S*)"
    r"|(?P<foreign>[^\W\d]\w*)\s*(?:>=|<=|>|<|≥|≤)"
    r"|\"(?P<quoted>[^\"]*)\"?|(?P<word>\S+)",
    re.IGNORECASE,
)
_Choice = TypeVar("_Choice")
_UNIT: Final = re.compile(r"(?:°|deg|m/s|s)$")


@dataclass(slots=True)
class Wanted:
    """What a search asks for: all of it.

    Attributes:
        words: parts of any text of a recording, folded.
        fields: name of a field of its session, and a part of its text, folded.
        figures: column of `jumps`, comparison in SQL, number; all of one and the same jump.
        durations: likewise, s, of the recording.
        since: begun at these times or later.
        until: begun before these times.
        levels: how grave its verdict is.
        tags: that it has, folded.
        favourite: whether it is one; None: whichever.
    """

    words: list[str] = field(default_factory=list)
    fields: list[tuple[str, str]] = field(default_factory=list)
    figures: list[tuple[str, str, float]] = field(default_factory=list)
    durations: list[tuple[str, float]] = field(default_factory=list)
    since: list[datetime] = field(default_factory=list)
    until: list[datetime] = field(default_factory=list)
    levels: list[Level] = field(default_factory=list)
    tags: list[str] = field(default_factory=list)
    favourite: bool | None = None


def understood(text: str) -> Wanted:
    """What a text asks for.

    A number may have a decimal comma and its unit behind it. Days are those of this computer's clock.

    Raises:
        BadInputError: a condition cannot be understood; the message says which, and what is possible.
    """
    wanted = Wanted()
    for term in _TERM.finditer(text):
        found = term.groupdict()
        if found["ordered"]:
            sign = found["sign"].strip().casefold().replace("≥", ">=").replace("≤", "<=")
            if not found["bound"]:
                raise _unfinished(found["ordered"].casefold(), sign)
            _compare(wanted, found["ordered"].casefold(), _COMPARISONS[sign], found["bound"])
        elif found["equal"]:
            _equal(wanted, found["name"].casefold(), found["value"].strip('"'))
        elif found["foreign"]:
            raise _unknown(found["foreign"])
        elif words := folded(found["word"] or found["quoted"] or ""):
            wanted.words.append(words)
    return wanted


def _compare(wanted: Wanted, name: str, sign: str, bound: str) -> None:
    if name == "date":
        first, after = _days(bound)
        if sign == ">=":
            wanted.since.append(first)
        elif sign == ">":
            wanted.since.append(after)
        else:
            wanted.until.append(first if sign == "<" else after)
    elif name == "duration":
        wanted.durations.append((sign, _number(name, bound)))
    else:
        wanted.figures.append((QUANTITIES[name], sign, _number(name, bound)))


def _equal(wanted: Wanted, name: str, value: str) -> None:
    if not value:
        return  # it is still being typed
    if name == "date":
        first, after = _days(value)
        wanted.since.append(first)
        wanted.until.append(after)
    elif name == "verdict":
        wanted.levels.append(_one_of(name, value, {level.value: level for level in Level}))
    elif name == "favourite":
        wanted.favourite = _one_of(name, value, _FAVOURITE)
    elif name == "tag":
        wanted.tags.append(folded(value))
    elif name in QUANTITIES or name == "duration":
        raise _unknown(name)
    else:
        wanted.fields.append(("notes" if name == "note" else name, folded(value)))


def _one_of(name: str, value: str, known: Mapping[str, _Choice]) -> _Choice:
    if (chosen := known.get(value.casefold())) is None:
        raise BadInputError(
            phrase(
                "search_value",
                "{name}:{value} is not known: write one of {known}",
                name=name,
                value=value,
                known=", ".join(f"{name}:{each}" for each in known),
            )
        )
    return chosen


def _number(name: str, text: str) -> float:
    try:
        return float(_UNIT.sub("", text.casefold()).replace(",", "."))
    except ValueError:
        raise BadInputError(
            phrase("search_number", "{name}: {text} is no number: write for example {name} > 48", name=name, text=text)
        ) from None


#: A date and how it goes on: a year, a month of it, a day of it.
_DATES: Final[tuple[tuple[str, Callable[[datetime], datetime]], ...]] = (
    ("%Y-%m-%d", lambda day: day + timedelta(days=1)),
    ("%Y-%m", lambda day: (day + timedelta(days=31)).replace(day=1)),
    ("%Y", lambda day: (day + timedelta(days=366)).replace(month=1, day=1)),
)


def _days(text: str) -> tuple[datetime, datetime]:
    """When a day, a month or a year begins, and when the next one does, by this computer's clock."""
    for form, following in _DATES:
        try:
            first = datetime.strptime(text, form)
            return first.astimezone(), following(first).astimezone()
        except (ValueError, OverflowError):
            continue
    raise BadInputError(
        phrase("search_date", "date {text} is not understood: write 2026-11-21, 2026-11 or 2026", text=text)
    )


def _unfinished(name: str, sign: str) -> BadInputError:
    bound = "2026-11-21" if name == "date" else "48"
    text = "{name} {sign} what? write for example {name} {sign} {bound}, or put quotes around words"
    return BadInputError(phrase("search_unfinished", text, name=name, sign=sign, bound=bound))


def _unknown(name: str) -> BadInputError:
    known = ", ".join(_ORDERED)
    return BadInputError(
        phrase(
            "search_quantity",
            "{name} cannot be compared with a number: write > or < behind one of {known}, or put quotes around words",
            name=name,
            known=known,
        )
    )
