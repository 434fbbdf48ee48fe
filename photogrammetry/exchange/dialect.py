"""Reads text in columns as rows of cells: one encoding, one separator and one decimal mark for the whole file.

Cells are separated by semicolons, tabs, commas or blanks: by the first of them that stands outside of quotes, or by
that of a first line `sep=;` (Excel). Double quotes hold a cell together. A file that can be read in two ways is
refused.
"""

import codecs
import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.errors import BadInputError
from rig.settings.strict_toml import read_bytes

_QUOTED: Final = re.compile(r'"(?:[^"]|"")*"')
_BLANKS: Final = re.compile(r'("(?:[^"]|"")*")|[ \t]+')
_COMMENT: Final = ("#", "!")
_SEPARATORS: Final = (";", "\t", ",", " ")
_DECIMAL_COMMA: Final = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?", re.ASCII)
_THOUSANDS: Final = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}", re.ASCII)
_NUMBER: Final = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?", re.ASCII)


@dataclass(frozen=True, slots=True)
class Row:
    """A line of a file.

    Attributes:
        place: file and line, for messages.
        cells: without quotes and without blanks around them.
        comment: whether it is one; its mark is no part of the cells.
        text: the line; `q` stands for what is in quotes.
    """

    place: str
    cells: tuple[str, ...]
    comment: bool
    text: str


@dataclass(frozen=True, slots=True)
class Rows:
    """The lines of a file that are not empty.

    Attributes:
        rows: in the order of the file.
        separator: of cells.
        notes: what was assumed.
    """

    rows: tuple[Row, ...]
    separator: str
    notes: tuple[str, ...]


def read_rows(path: Path) -> Rows:
    """Read the rows of a text file: UTF-8, UTF-16 with its mark, or else Windows-1252 (Latin-1), which is noted.

    Raises:
        BadInputError: missing, unreadable, no text, or a quote that is not closed.
    """
    text, notes = _text(path)
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    first = next((i for i, line in enumerate(lines) if line.strip() and not _is_comment(line)), 0)
    named = re.fullmatch(r'"?sep=(.)"?', lines[first])
    if named is not None:
        lines[first] = ""
        if named[1] not in _SEPARATORS:
            raise BadInputError(
                f"{path}: line {first + 1}: {named[0]}: the separator must be one of ; , tab; save it so"
            )
    separator = named[1] if named is not None else _separator([line for line in lines if not _is_comment(line)])
    rows = []
    for number, line in enumerate(lines, start=1):
        comment, place = _is_comment(line), f"{path}: line {number}"
        cells = _comment_cells(line, separator) if comment else _cells(line, separator, place)
        if any(cells):
            rows.append(Row(place, tuple(cells), comment, _QUOTED.sub("q", line)))
    return Rows(tuple(rows), separator, notes)


def is_number(word: str) -> bool:
    """Whether a cell holds a number, with a decimal point or a decimal comma."""
    return _NUMBER.fullmatch(word) is not None


def with_points(words: Sequence[str], separator: str, path: Path) -> dict[str, str]:
    """The cells that hold numbers, with decimal points instead of decimal commas.

    Args:
        words: all cells of the file in columns of numbers.
        separator: of the file.
        path: of the file, for messages.

    Raises:
        BadInputError: the file has decimal commas and decimal points, or commas that may separate thousands: all stand
            before three digits, and beside them are whole numbers, as if 1,234 were one too.
    """
    comma = next((word for word in words if "," in word and is_number(word)), None)
    point = next((word for word in words if "." in word and is_number(word)), None)
    if comma is not None and (point is not None or separator == ","):
        beside = f"beside {point!r}" if point is not None else "in a file that commas separate"
        raise BadInputError(
            f"{path}: the comma of {comma!r} {beside} is a decimal comma or none; write all numbers with decimal points"
        )
    commas = [word for word in words if "," in word and is_number(word)]
    whole = next((word for word in words if word.lstrip("+-").isdecimal() and int(word)), None)
    if commas and whole is not None and all(map(_THOUSANDS.fullmatch, commas)):
        raise BadInputError(
            f"{path}: the comma of {comma!r} beside {whole!r} may separate thousands; write all numbers with decimal "
            "points"
        )
    return {word: word.replace(",", ".") if is_number(word) else word for word in words}


def _text(path: Path) -> tuple[str, tuple[str, ...]]:
    """The text of a file, and a note where its encoding was assumed."""
    data, notes = read_bytes(path, "text", "an existing file"), ()
    try:
        text = data.decode("utf-16" if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig")
    except UnicodeDecodeError:
        try:
            text = data.decode("cp1252")
        except UnicodeDecodeError:
            raise BadInputError(f"{path}: is text of an unknown encoding; save it as UTF-8") from None
        return _seen(text, path), (_assumed(text, path),)
    return _seen(text, path), notes


def _seen(text: str, path: Path) -> str:
    if "\0" in text:
        raise BadInputError(f"{path}: is no text file, or UTF-16 without its mark; save it as text in UTF-8")
    return text


def _assumed(text: str, path: Path) -> str:
    word = next(word for word in re.split(r"[ \t\r\n;,]+", text) if not word.isascii())  # \s would split at \xa0
    return f"{path.name}: is no UTF-8, taken as Windows-1252 (Latin-1): look whether {word!r} is right"


def _is_comment(line: str) -> bool:
    return line.lstrip().startswith(_COMMENT)


def _separator(lines: Sequence[str]) -> str:
    bare = [_QUOTED.sub("q", line) for line in lines]
    for separator in (";", "\t"):
        if any(separator in line for line in bare):
            return separator
    with_commas = [line for line in bare if "," in line]
    return "," if not all(_has_decimal_commas(line) for line in with_commas) else " "


def _has_decimal_commas(line: str) -> bool:
    """Whether blanks separate the cells of a line, and all its commas are decimal ones."""
    words = line.split()
    return len(words) > 1 and all(_DECIMAL_COMMA.fullmatch(word) for word in words if "," in word)


def _cells(line: str, separator: str, place: str) -> list[str]:
    if separator == " ":
        line = _BLANKS.sub(lambda found: found[1] or " ", line.strip())
    try:
        found = next(csv.reader([line], delimiter=separator, skipinitialspace=separator != " ", strict=True), [])
    except csv.Error:
        raise BadInputError(
            f'{place}: a double quote is not closed, or text follows it; write "..." around the whole cell'
        ) from None
    return [cell.strip() for cell in found]


def _comment_cells(line: str, separator: str) -> list[str]:
    """The words of a comment; it may name columns with blanks where the lines have another separator."""
    words = line.lstrip("#! \t")
    separated = [word.strip().strip('"') for word in words.split(separator if separator != " " else None)]
    return separated if len(separated) > 1 else words.split()
