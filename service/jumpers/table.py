"""Reads a start list from a table as spreadsheets and competition programs write it: text, or an Excel workbook."""

import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from pydantic import ValidationError

from rig.api.start_list import COLUMN_NAME_MAX, COLUMNS_MAX, LINES_MAX, NewLine
from rig.errors import BadInputError
from rig.phrase import phrase
from service.jumpers.encodings import texts_of
from service.jumpers.workbook import MAGIC, OLD_MAGIC, Row, Sheet, sheets_of

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
#: Columns that hold numbers.
_NUMBERS: Final = frozenset({"bib", "gate"})
_DATE: Final = re.compile(r"\d{4}-\d\d-\d\d")
#: Names that a log's session record has for other things.
_RESERVED: Final = frozenset(
    {"session", "recording", "continues", "continues_after", "part", "round", "wind", "operator"}
)


#: A heading stands among so many first rows that hold something.
_HEADING_WITHIN: Final = 30
_EXAMPLE: Final = "e.g. bib;athlete;gate;club"


@dataclass(frozen=True, slots=True)
class Table:
    """What a table holds.

    Attributes:
        columns: names of its own columns.
        lines: the jumpers, in its order.
        named: all columns that its heading names, known ones by our names for them.
        heading: number of the line of the heading.
    """

    columns: tuple[str, ...]
    lines: tuple[NewLine, ...]
    named: tuple[str, ...] = ()
    heading: int = 0


@dataclass(frozen=True, slots=True)
class Reading:
    """One way to read a file.

    Attributes:
        encoding: of its letters; "": a workbook, in which that is certain.
        sheet: of a workbook; "": the file is none.
        table: what it holds; None: of several sheets one has to be chosen first.
    """

    encoding: str
    sheet: str
    table: Table | None


def readings_of(content: bytes, encoding: str | None = None, sheet: str | None = None) -> tuple[Reading, ...]:
    """The ways in which a file can be read: one if that is certain, several if a person has to look.

    Lines above the heading are skipped: the heading is the first line that names most of the columns `bib`, `athlete`
    (or first and last name), `gate`, `club` and `notes`, in any order. Other columns are kept under their names.

    Args:
        content: an Excel workbook, or text whose columns semicolons, commas or tabs separate.
        encoding: of the text, as a person has said; None: nobody has.
        sheet: of the workbook, likewise.

    Raises:
        BadInputError: columns are missing, named twice or of names that are taken; a line does not fit the columns; a
            bib stands there twice. The message names column and line.
    """
    if content.startswith(MAGIC):
        return _sheets(sheets_of(content), sheet)
    if content.startswith(OLD_MAGIC):
        raise BadInputError(
            phrase("list_xls", "the start list is a workbook of an old Excel (.xls): save it as .xlsx, and load that")
        )
    found: list[Reading] = []
    problem: BadInputError | None = None
    for text in texts_of(content, encoding):
        try:
            table = _table(_separated(text.text))
        except BadInputError as error:
            problem = problem or error
            continue
        if all(table != other.table for other in found):  # letters that differ may stand above the heading alone
            found.append(Reading(text.encoding, "", table))
    if not found and problem is not None:
        raise problem
    return tuple(found)


def read_table(content: bytes, encoding: str | None = None, sheet: str | None = None) -> Table:
    """Read a file that can be read in one way only; arguments and errors as for `readings_of`.

    Raises:
        BadInputError: also if it can be read in several ways; the message names them.
    """
    found = readings_of(content, encoding, sheet)
    if len(found) == 1 and found[0].table is not None:
        return found[0].table
    if found[0].sheet:
        text = "several sheets hold a list ({sheets}): say which `sheet`"
        raise BadInputError(phrase("list_sheets", text, sheets=", ".join(each.sheet for each in found)))
    text = (
        'its letters can be read in several ways ({encodings}): give the `encoding`, or save the list as "CSV UTF-8" '
        "or as an Excel workbook"
    )
    raise BadInputError(phrase("list_letters", text, encodings=", ".join(each.encoding for each in found)))


def _sheets(sheets: tuple[Sheet, ...], wanted: str | None) -> tuple[Reading, ...]:
    if not sheets:
        text = "the workbook is empty: a line of it names the columns, {example}"
        raise BadInputError(phrase("list_book_empty", text, example=_EXAMPLE))
    if wanted is not None:
        sheets = tuple(sheet for sheet in sheets if sheet.name == wanted)
        if not sheets:
            text = 'the workbook has no sheet "{sheet}" that holds something: name another one'
            raise BadInputError(phrase("list_no_sheet", text, sheet=wanted))
    headed = [sheet for sheet in sheets if _heading(sheet.rows) is not None] or list(sheets[:1])
    if len(headed) > 1:
        return tuple(Reading("", sheet.name, None) for sheet in headed)
    return (Reading("", headed[0].name, _table(headed[0].rows)),)


def _separated(text: str) -> Sequence[Row]:
    """The rows of a text, by the separator that finds most columns in a heading."""
    if not text.strip(' \r\n\t;,"'):
        return ()
    lines = text.splitlines(keepends=True)
    if lines and (told := re.fullmatch(r'"?sep=(.)"?\s*', lines[0], re.IGNORECASE)):
        return _rows(lines[1:], told[1], 1)  # a line for spreadsheets
    best: Sequence[Row] = ()
    problem: BadInputError | None = None
    for separator in _SEPARATORS:
        try:
            rows = _rows(lines, separator, 0)
        except BadInputError as error:
            problem = problem or error
            continue
        if not best or _merit(rows) > _merit(best):
            best = rows
    if not best and problem is not None:
        raise problem
    return best


def _merit(rows: Sequence[Row]) -> tuple[int, int]:
    """How many columns a heading names: known ones, and all."""
    heading = _heading(rows)
    first = rows[0][1] if rows else []
    return (0, len(first)) if heading is None else (_known(rows[heading][1]), len(rows[heading][1]))


def _rows(lines: Sequence[str], separator: str, skipped: int) -> Sequence[Row]:
    """The rows that hold something, with the numbers of their lines."""
    reader = csv.reader(io.StringIO("".join(lines), newline=""), delimiter=separator, skipinitialspace=True)
    rows = []
    try:
        for row in reader:
            fields = [field.strip() for field in row]
            if any(fields):
                rows.append((reader.line_num + skipped, fields))
    except csv.Error as error:
        text = "line {line}: {why}; look at its quotation marks"
        line = reader.line_num + skipped
        raise BadInputError(phrase("list_quotes", text, line=line, why=str(error))) from None
    return rows


def _heading(rows: Sequence[Row]) -> int | None:
    """Index of the heading: of the first rows the one that names most columns; None: none says who jumps."""
    known = [_known(row) for _, row in rows[:_HEADING_WITHIN]]
    most = max(known, default=0)
    return known.index(most) if most else None


def _known(row: Sequence[str]) -> int:
    """How many known columns a row names; 0 if it does not name who jumps."""
    names = {name for field in row if (name := _KNOWN.get(_bare(field)))}
    return len(names) if names & {"bib", "athlete", _FIRST, _LAST} else 0


def _bare(name: str) -> str:
    return re.sub(r"[\W_]", "", name.lower())


def _table(rows: Sequence[Row]) -> Table:
    if not rows:
        text = "the start list is empty: a line of it names the columns, {example}"
        raise BadInputError(phrase("list_empty", text, example=_EXAMPLE))
    heading = _heading(rows)
    number, header = rows[heading or 0]
    columns = _columns(header)
    rest = rows[(heading or 0) + 1 :]
    lines = tuple(_line(number, row, columns) for number, row in rest)
    if len(lines) > LINES_MAX:
        text = "the start list has {jumpers} jumpers: {most} at most, so make several of it"
        raise BadInputError(phrase("list_long", text, jumpers=len(lines), most=LINES_MAX))
    _check_bibs([number for number, _ in rest], lines)
    named = tuple(name.replace("\0", "") for name in columns if name)
    return Table(tuple(name for name in columns if name and name not in _NAMES), lines, named, number)


def _columns(header: Sequence[str]) -> list[str]:
    """The columns by their known or own names; "" for one without a name and content."""
    columns = [_KNOWN.get(_bare(name), name) for name in header]
    listed = ", ".join(f'"{name}"' for name in header)
    if not {"bib", "athlete", _FIRST, _LAST} & set(columns):
        text = (
            'no line names a column "bib" or "athlete"; the first one has {listed}: name the columns above the '
            "jumpers, {example}"
        )
        raise BadInputError(phrase("list_no_columns", text, listed=listed, example=_EXAMPLE))
    for name, count in Counter(columns).items():
        if name and count > 1:
            what = name.replace("\0", "") + " name" if "\0" in name else name
            text = 'column "{column}" is there twice in {listed}: keep one'
            raise BadInputError(phrase("list_column_twice", text, column=what, listed=listed))
        if name in _RESERVED:
            text = 'column "{column}" has a name that every jump uses for something else: rename it'
            raise BadInputError(phrase("list_column_taken", text, column=name))
        if len(name) > COLUMN_NAME_MAX:
            text = 'column "{column}…" has a name of {length} characters: shorten it'
            raise BadInputError(phrase("list_column_long", text, column=name[:20], length=len(name)))
    if len(own := [name for name in columns if name and name not in _NAMES]) > COLUMNS_MAX:
        text = "{columns} own columns: {most} at most, so remove some, e.g. {last}"
        raise BadInputError(phrase("list_columns", text, columns=len(own), most=COLUMNS_MAX, last=own[-1]))
    return columns


def _line(number: int, row: Sequence[str], columns: Sequence[str]) -> NewLine:
    while len(row) > len(columns) and not row[-1]:
        row = row[:-1]
    if len(row) > len(columns):
        text = "line {line} has {fields} fields, and the heading names {columns} columns: correct it"
        raise BadInputError(phrase("list_fields", text, line=number, fields=len(row), columns=len(columns)))
    fields = {name: text for name, text in zip(columns, row, strict=False) if text}
    for name in _NUMBERS & fields.keys():
        fields[name] = re.sub(r"(\d+)\.0+", r"\1", fields[name])  # as programs write whole numbers
    if _DATE.fullmatch(fields.get("bib", "")):
        text = "line {line}: the bib {bib} is a date: give the column the format of a number"
        raise BadInputError(phrase("list_bib_date", text, line=number, bib=fields["bib"]))
    if unnamed := fields.pop("", ""):
        text = 'line {line} has "{field}" in a column without a name: name it in the heading'
        raise BadInputError(phrase("list_unnamed", text, line=number, field=unnamed[:40]))
    names = [fields.pop(name, "") for name in (_FIRST, _LAST)]
    fields.setdefault("athlete", " ".join(name for name in names if name))
    more = {name: fields.pop(name) for name in list(fields) if name not in _NAMES}
    try:
        return NewLine(**fields, more=more)
    except ValidationError as error:
        first = error.errors()[0]
        column = ".".join(str(part) for part in first["loc"])
        if (most := first.get("ctx", {}).get("max_length")) is not None:
            text = "line {line}, column {column}: more than {most} letters; shorten it"
            raise BadInputError(phrase("list_field_long", text, line=number, column=column, most=most)) from None
        text = "line {line}, column {column}: holds letters that nobody sees, such as a tab; take them out"
        raise BadInputError(phrase("list_field_unseen", text, line=number, column=column)) from None


def _check_bibs(numbers: Sequence[int], lines: Sequence[NewLine]) -> None:
    seen: dict[str, int] = {}
    for number, line in zip(numbers, lines, strict=True):
        if line.bib and line.bib in seen:
            text = "bib {bib} stands in lines {first} and {second}: give each its own"
            raise BadInputError(phrase("list_bib_twice", text, bib=line.bib, first=seen[line.bib], second=number))
        seen[line.bib] = number
