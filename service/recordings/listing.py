"""Finds and sorts recordings of the catalogue for a list."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import islice
from typing import Any, Final

from recorder.catalogue.entry import Entry
from recorder.log.extent import CONTINUES, CONTINUES_AFTER
from rig.api.fields import LONGEST_LINE, LONGEST_TAG
from rig.api.recordings import RecordingQuery, SessionFields, Sorting
from rig.api.start_list import COLUMN_NAME_MAX, COLUMNS_MAX
from rig.api.statement import Level
from rig.clocks import NS_PER_S, UtcNs
from service.recordings.notes import NOTE_FIELD

#: What a search looks at, beside the id.
_SEARCHED: Final = ("bib", "athlete", "notes", "gate", "tags")
_FAR: Final = 1 << 63
#: Session fields of which the program itself makes something.
_PROGRAMS: Final = frozenset(
    {*SessionFields.model_fields, "recording", "session", "tags", "favourite", CONTINUES, CONTINUES_AFTER}
)
#: What the start list says of a jumper beside the own columns.
_BESIDE_COLUMNS: Final = ("round", "club")


@dataclass(frozen=True, slots=True)
class Found:
    """What a query finds.

    Attributes:
        total: how many recordings fit, on all pages.
        entries: those of the page that was asked for, in order.
    """

    total: int
    entries: Sequence[Entry]


def find(entries: Iterable[Entry], query: RecordingQuery, level: Callable[[Entry], Level]) -> Found:
    """The recordings that fit a query, in its order; of these, one page.

    Args:
        entries: of the folder or of its trash, newest first.
        query: what is wanted.
        level: how grave the verdict of a recording is.
    """
    fitting = [
        entry for entry in entries if _fits(entry, query) and (query.verdict is None or query.verdict == level(entry))
    ]
    if query.sort is not Sorting.NEWEST:
        fitting.sort(key=_ORDERS[query.sort])
    end = None if query.limit is None else query.offset + query.limit
    return Found(len(fitting), fitting[query.offset : end])


def tags_of(entry: Entry) -> tuple[str, ...]:
    """The tags that people gave to a recording."""
    return tuple(filter(None, (tag.strip()[:LONGEST_TAG] for tag in entry.session.get("tags", "").split(","))))


def more_of(session: Mapping[str, str]) -> dict[str, str]:
    """What the start list had of the jumper: the fields of a session that are none of the program's own.

    No more and no longer than a start list can have: a log that somebody else has made may hold anything.
    """
    own = (
        (name, text[:LONGEST_LINE])
        for name, text in session.items()
        if name not in _PROGRAMS and not name.startswith(NOTE_FIELD) and len(name) <= COLUMN_NAME_MAX and text
    )
    return dict(islice(own, COLUMNS_MAX + len(_BESIDE_COLUMNS)))


def is_favourite(entry: Entry) -> bool:
    """Whether a recording is marked as a favourite."""
    return bool(entry.session.get("favourite"))


def _fits(entry: Entry, query: RecordingQuery) -> bool:
    session = entry.session
    return (
        (query.favourite is None or query.favourite == is_favourite(entry))
        and (not query.bib or session.get("bib", "").strip().casefold() == query.bib.strip().casefold())
        and (not query.athlete or query.athlete.casefold() in session.get("athlete", "").casefold())
        and (not query.tag or query.tag.casefold() in {tag.casefold() for tag in tags_of(entry)})
        and (query.since is None or utc(entry.started or entry.modified) >= query.since)
        and (query.until is None or utc(entry.started or entry.modified) < query.until)
        and (not query.search or _mentions(entry, query.search))
    )


def _mentions(entry: Entry, words: str) -> bool:
    """Whether each of the words stands somewhere in what a recording says of itself."""
    text = " ".join([entry.id, *(entry.session.get(field, "") for field in _SEARCHED)]).casefold()
    return all(word in text for word in words.casefold().split())


def utc(time: UtcNs) -> datetime:
    """A time as the API gives it: to the microsecond."""
    return datetime.fromtimestamp(time / NS_PER_S, UTC)


def _newest_first(entry: Entry) -> int:
    return -(entry.started or entry.modified)


def _by_bib(entry: Entry) -> Any:
    bib = entry.session.get("bib", "").strip()
    number = int(bib) if bib.isascii() and bib.isdecimal() and len(bib) < 19 else _FAR
    return number, not bib, bib.casefold(), _newest_first(entry)


def _by_athlete(entry: Entry) -> Any:
    athlete = entry.session.get("athlete", "").strip().casefold()
    return not athlete, athlete, _newest_first(entry)


_ORDERS: Final[dict[Sorting, Callable[[Entry], Any]]] = {
    Sorting.OLDEST: lambda entry: (entry.started or entry.modified, entry.id),
    Sorting.BIB: _by_bib,
    Sorting.ATHLETE: _by_athlete,
    Sorting.LONGEST: lambda entry: (-entry.duration_s, _newest_first(entry)),
}
