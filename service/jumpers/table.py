"""Reads a start list from a table of comma-separated values, as spreadsheets and competition programs write it."""

import csv
import io
import re
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from pydantic import ValidationError

from rig.api.start_list import COLUMN_NAME_MAX, COLUMNS_MAX, LINES_MAX, NewLine
from rig.errors import BadInputError

_SEPARATORS: Final = (";", ",", "\t")
#: Parts of the name, which no own column is called by.
_FIRST, _LAST = "\0first", "\0last"
#: What the columns are called, in English and Norwegian; letters and digits alone, lower case.
_NAMES: Final = {
    "bib": ("bib", "bibno", "no", "nr", "number", "startno", "startnr", "startnummer", "startnumber"),
    "athlete": ("athlete", "name", "navn", "utøver", "hopper", "jumper"),
    "gate": ("gate", "bom", "startgate"),
    "club": ("club", "klubb", "team", "lag"),
    "notes": ("notes", "note", "merknad", "merknader"),
    _FIRST: ("firstname", "fornavn", "givenname"),
    _LAST: ("lastname", "etternavn", "surname", "familyname"),
}
_KNOWN: Final = {name: column for column, names in _NAMES.items() for name in names}
#: Names that a log's session record has for other things.
_RESERVED: Final = frozenset({"session", "recording", "continues", "continues_after", "round", "wind", "operator"})


@dataclass(frozen=True, slots=True)
class Table:
    """What a table holds.

    Attributes:
        columns: names of its own columns.
        lines: the jumpers, in its order.
    """

    columns: tuple[str, ...]
    lines: tuple[NewLine, ...]


def read_table(content: bytes) -> Table:
    """Read a table whose first line names the columns.

    The encoding is UTF-8, UTF-16 with a byte order mark, or else Latin-1; columns are separated by semicolons, commas
    or tabs. `bib`, `athlete` (or first and last name), `gate`, `club` and `notes` are known, in any order; other
    columns are kept under their names.

    Raises:
        BadInputError: columns are missing, named twice or of names that are taken; a line does not fit the columns; a
            bib stands there twice. The message names column and line.
    """
    rows = list(_rows(_decoded(content)))
    if not rows:
        raise BadInputError("the start list is empty: its first line names the columns, e.g. bib;athlete;gate;club")
    (_, header), rest = rows[0], rows[1:]
    columns = _columns(header)
    lines = tuple(_line(number, row, columns) for number, row in rest)
    if len(lines) > LINES_MAX:
        raise BadInputError(f"the start list has {len(lines)} jumpers: {LINES_MAX} at most, so make several of it")
    _check_bibs([number for number, _ in rest], lines)
    return Table(tuple(name for name in columns if name and name not in _NAMES), lines)


def _decoded(content: bytes) -> str:
    if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        text = content.decode("utf-16", errors="replace")
    else:
        try:
            text = content.removeprefix(BOM_UTF8).decode("utf-8")
        except UnicodeDecodeError:
            text = content.decode("cp1252", errors="replace")  # Latin-1 as Windows writes it
    if "\0" in text:
        raise BadInputError("the start list is no text: save it as CSV (comma-separated values), then load that")
    return text


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """The rows that hold something, with the numbers of their lines."""
    lines = text.splitlines(keepends=True)
    skipped = 0
    separator = ""
    if lines and (told := re.fullmatch(r'"?sep=(.)"?\s*', lines[0], re.IGNORECASE)):
        separator, skipped, lines = told[1], 1, lines[1:]  # a line for spreadsheets
    head = next((line for line in lines if line.strip()), "")
    separator = separator or max(_SEPARATORS, key=head.count)
    reader = csv.reader(io.StringIO("".join(lines), newline=""), delimiter=separator, skipinitialspace=True)
    try:
        for row in reader:
            fields = [field.strip() for field in row]
            if any(fields):
                yield reader.line_num + skipped, fields
    except csv.Error as error:
        raise BadInputError(f"line {reader.line_num + skipped}: {error}; look at its quotation marks") from None


def _columns(header: Sequence[str]) -> list[str]:
    """The columns by their known or own names; "" for one without a name and content."""
    columns = [_KNOWN.get(re.sub(r"[\W_]", "", name.lower()), name) for name in header]
    listed = ", ".join(f'"{name}"' for name in header)
    if not {"bib", "athlete", _FIRST, _LAST} & set(columns):
        raise BadInputError(
            f'the first line names no column "bib" or "athlete", but {listed}: name the columns there, e.g. '
            "bib;athlete;gate;club"
        )
    for name, count in Counter(columns).items():
        if name and count > 1:
            what = name.replace("\0", "") + " name" if "\0" in name else name
            raise BadInputError(f'column "{what}" is there twice in {listed}: keep one')
        if name in _RESERVED:
            raise BadInputError(f'column "{name}" has a name that every jump uses for something else: rename it')
        if len(name) > COLUMN_NAME_MAX:
            raise BadInputError(f'column "{name[:20]}…" has a name of {len(name)} characters: shorten it')
    if len(own := [name for name in columns if name and name not in _NAMES]) > COLUMNS_MAX:
        raise BadInputError(f"{len(own)} own columns: {COLUMNS_MAX} at most, so remove some, e.g. {own[-1]}")
    return columns


def _line(number: int, row: Sequence[str], columns: Sequence[str]) -> NewLine:
    while len(row) > len(columns) and not row[-1]:
        row = row[:-1]
    if len(row) > len(columns):
        raise BadInputError(
            f"line {number} has {len(row)} fields, and the first line names {len(columns)} columns: correct it"
        )
    fields = {name: text for name, text in zip(columns, row, strict=False) if text}
    if unnamed := fields.pop("", ""):
        raise BadInputError(f'line {number} has "{unnamed[:40]}" in a column without a name: name it in the first line')
    names = [fields.pop(name, "") for name in (_FIRST, _LAST)]
    fields.setdefault("athlete", " ".join(name for name in names if name))
    more = {name: fields.pop(name) for name in list(fields) if name not in _NAMES}
    try:
        return NewLine(**fields, more=more)
    except ValidationError as error:
        first = error.errors()[0]
        column = ".".join(str(part) for part in first["loc"])
        raise BadInputError(f"line {number}, column {column}: {first['msg']}; correct it") from None


def _check_bibs(numbers: Sequence[int], lines: Sequence[NewLine]) -> None:
    seen: dict[str, int] = {}
    for number, line in zip(numbers, lines, strict=True):
        if line.bib and line.bib in seen:
            raise BadInputError(f"bib {line.bib} stands in lines {seen[line.bib]} and {number}: give each its own")
        seen[line.bib] = number
