"""What a file would make of the start list, shown to a person before it replaces the list."""

from collections.abc import Sequence
from typing import Final

from rig.api.start_list import NewLine, Preview, ReadingChoice, StartList
from service.jumpers.table import Reading, Table

_LINES_SHOWN: Final = 5
#: So many texts that differ show which letters are right.
_WORDS: Final = 6
_FIELDS: Final = ("bib", "athlete", "gate", "club", "notes")


def previewed(readings: Sequence[Reading], present: StartList) -> Preview:
    """The preview of a file.

    Args:
        readings: the ways in which it can be read.
        present: the list now.
    """
    first = readings[0]
    table = first.table or Table((), ())
    certain = len(readings) == 1
    there = _columns_of(present)
    named = tuple("athlete" if name in {"first", "last"} else name for name in table.named)
    return Preview(
        jumpers=len(table.lines),
        lines=table.lines[:_LINES_SHOWN],
        columns=table.named,
        added=tuple(name for name in dict.fromkeys(named) if name not in there),
        removed=tuple(name for name in there if name not in named) if table.named else (),
        heading=table.heading,
        encoding=(first.encoding or None) if certain else None,
        sheet=(first.sheet or None) if certain else None,
        readings=() if certain or first.sheet else _choices(readings),
        sheets=tuple(each.sheet for each in readings) if not certain and first.sheet else (),
    )


def _columns_of(present: StartList) -> tuple[str, ...]:
    """The columns that the list has something in, and its own ones."""
    used = tuple(name for name in _FIELDS if any(getattr(line, name) for line in present.lines))
    return (*used, *present.columns)


def _choices(readings: Sequence[Reading]) -> tuple[ReadingChoice, ...]:
    """Each way to read the letters, with the texts in which it differs from the others."""
    columns = [_texts(reading.table) for reading in readings]
    differing = [each for each in dict.fromkeys(zip(*columns, strict=False)) if len(set(each)) > 1][:_WORDS]
    return tuple(
        ReadingChoice(encoding=reading.encoding, words=tuple(each[place] for each in differing))
        for place, reading in enumerate(readings)
    )


def _texts(table: Table | None) -> list[str]:
    """All texts of a table, in the order of its file."""
    if table is None:
        return []
    return [*table.named, *(text for line in table.lines for text in _texts_of(line))]


def _texts_of(line: NewLine) -> tuple[str, ...]:
    return (*(getattr(line, name) for name in _FIELDS), *line.more.values())
