"""Reads files in columns as lines of named numbers, by the columns that the file names or else the usual ones.

A line of words before the numbers, or a comment with them, names the columns. Then each line has as many cells; a
line of .ior may end early. `dialect` decides about separators, decimal marks and encodings.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from photogrammetry.exchange.dialect import Row, Rows, is_number, read_rows, with_points
from photogrammetry.exchange.part import numbers
from rig.errors import BadInputError

#: Usual columns by the file's ending; a line may end early.
_USUAL_COLUMNS: Final[Mapping[str, tuple[str, ...]]] = {
    ".csv": ("name", "x", "y", "z", "sx", "sy", "sz"),
    ".obc": ("name", "x", "y", "z", "sx", "sy", "sz"),
    ".phc": ("image", "name", "x", "y", "sx", "sy"),
    ".ior": ("camera", "c", "x0", "y0", "a1", "a2", "r0", "a3", "b1", "b2", "c1", "c2"),
    ".eor": ("image", "camera", "x0", "y0", "z0"),
}
ENDINGS: Final = tuple(_USUAL_COLUMNS)
#: Other names of columns.
_SAME: Final = {
    **dict.fromkeys(("point", "id", "nr", "ball", "target", "punkt", "navn"), "name"),
    **{f"sigma{gap}{axis}": f"s{axis}" for gap in ("", "_") for axis in "xyz"},
    "sigma": "s",
    "xh": "x0",
    "yh": "y0",
    "ck": "c",
}
_LABELS: Final = ("name", "image", "camera")
ANGLES: Final = ("omega", "phi", "kappa")
ANGLE_UNITS: Final = {"deg": math.pi / 180.0, "gon": math.pi / 200.0, "rad": 1.0}
SIGMAS: Final = ("s", "sx", "sy", "sz")
#: Columns beside the usual ones.
_MORE: Final[Mapping[str, frozenset[str]]] = {
    ".csv": frozenset({"s"}),
    ".obc": frozenset({"s"}),
    ".phc": frozenset({"s"}),
    ".ior": frozenset(),
    ".eor": frozenset(f"{angle}_{unit}" for angle in ANGLES for unit in ANGLE_UNITS),
}
_FEWEST_NAMED: Final = 3  # columns, in a comment that is a head
_AFTER_MARK: Final = re.compile(r"[^\s#!]\S*")  # words of a comment
#: Blanks that may be an empty cell.
_WIDE: Final = re.compile(r"^[ \t]|[ \t]{2}|[ \t]$")
#: Sigmas of one point that differ by more: no survey knows one coordinate so much better than another.
_UNLIKE: Final = 10.0
_WITH_UNIT: Final = re.compile(r"(\w+) *[\[(].*[\])]")
#: No principal point is so far from the middle of a picture: mm, and as a share of c.
_FAR_MM: Final = 1.0
_FAR_SHARE: Final = 0.1
#: Axes of a surveyor, by what they are: X is east, Y north, Z height, which is right-handed.
_SURVEYORS: Final = {
    **dict.fromkeys(("e", "east", "easting", "øst"), "x"),
    **dict.fromkeys(("n", "north", "northing", "nord"), "y"),
    **dict.fromkeys(("h", "height", "høyde"), "z"),
}


@dataclass(frozen=True, slots=True)
class Line:
    """A line by the names of its columns; lacking ones, and empty cells, are not in it."""

    place: str
    labels: Mapping[str, str]
    values: Mapping[str, float]

    def triple(self, names: Sequence[str]) -> list[float] | None:
        """Three numbers, None if all of them lack.

        Raises:
            BadInputError: one or two of them lack.
        """
        there = [name for name in names if name in self.values]
        if there and len(there) < len(names):
            raise BadInputError(
                f"{self.place}: has {', '.join(there)} alone; write {', '.join(names)}, or none of them"
            )
        return [self.values[name] for name in names] if there else None


def read_lines(path: Path) -> tuple[list[Line], tuple[str, ...]]:
    """All lines of a file with their columns named, and what was assumed.

    Raises:
        BadInputError: no line, an unknown column or one twice, or a line with too many or too few cells.
    """
    ending = path.suffix.lower()
    file = read_rows(path)
    head, body = _head(file, ending)
    columns = _USUAL_COLUMNS[ending] if head is None else _named(head, ending)
    if not body:
        raise BadInputError(f"{path}: is empty; name a file with lines {', '.join(columns)}")
    for row in body:
        _check_count(row, columns, all_given=head is not None and ending != ".ior")
        if head is None or file.separator == ",":
            _check_end(row, len(columns) if head is None else len(head.cells))
    cells = [dict(zip(columns, row.cells, strict=False)) for row in body]
    words = [word for each in cells for column, word in each.items() if column not in _LABELS]
    points = with_points(words, file.separator, path)
    if file.separator == " " or (file.separator == "," and head is None):
        _check_names(file.separator, body)
    if head is None and ending == ".ior":
        _check_cameras(file.separator, body)
    if head is None:
        _check_unnamed(file.separator, words, path)
        if "sx" in columns:
            _check_even(body, columns)
            _check_first(file.separator, body, columns, path)
        if "sx" in columns and file.separator in (" ", ","):
            _check_sigmas(body, cells)
    if file.separator == " " and (head is not None or ending == ".eor"):
        _check_hidden(head, body, columns)
    if file.separator == " " and (ending == ".ior" or (head is None and "sx" in columns)):
        _check_blanks(body, columns)
    lines = [_line(row, each, points, ending) for row, each in zip(body, cells, strict=True)]
    hidden = sum(row.comment and row is not head and _may_be_data(row, body[0], file.separator) for row in file.rows)
    left_out = (f"{path.name}: {hidden} lines of numbers are comments (# or !) and left out",) if hidden else ()
    return lines, (*file.notes, *left_out)


def _head(file: Rows, ending: str) -> tuple[Row | None, list[Row]]:
    """The line that names the columns, None if there is none; and the lines with numbers."""
    body = [row for row in file.rows if not row.comment]
    if body and _is_head(body[0].cells, ending, fewest=0 if len(body[0].cells) >= _FEWEST_NAMED else 1):
        return body[0], body[1:]
    before = [row for row in file.rows[: file.rows.index(body[0])] if row.comment] if body else []
    fewest = min(_FEWEST_NAMED, len(_USUAL_COLUMNS[ending]) - 1)
    return next((row for row in reversed(before) if _is_head(row.cells, ending, fewest=fewest)), None), body


def _may_be_data(comment: Row, line: Row, separator: str) -> bool:
    """Whether a comment looks like a line: by its numbers, or by as many cells; words have blanks between them too."""
    count = sum(is_number(word) for word in comment.cells)
    fewest = 1 if separator == " " else 0
    return count >= _FEWEST_NAMED or (count >= fewest and len(comment.cells) == len(line.cells))


def _is_head(words: Sequence[str], ending: str, fewest: int) -> bool:
    """Whether a line names columns: no word of it is a number, and so many are known columns."""
    columns = [_column(word) for word in words]
    known = set(_USUAL_COLUMNS[ending]) | _MORE[ending]
    return not any(is_number(word) for word in words) and sum(column in known for column in columns) >= fewest


def _column(word: str) -> str:
    return (_SAME | _SURVEYORS).get(word.lower(), word.lower())


def _named(head: Row, ending: str) -> tuple[str, ...]:
    """The columns that a line names.

    Raises:
        BadInputError: one is not known, or there twice.
    """
    words = list(head.cells)
    while not words[-1]:
        words.pop()
    columns = tuple(_column(word) for word in words)
    known = (*_USUAL_COLUMNS[ending], *sorted(_MORE[ending]))
    given = {word.lower() for word in words}
    for word, column in zip(words, columns, strict=True):
        if column not in known and (named := _WITH_UNIT.fullmatch(column)) and _column(named[1]) in known:
            raise BadInputError(
                f"{head.place}: column {word!r}: all lengths of a file have one unit, which --length-unit says; name "
                f"the column {named[1]!r}"
            )
        if word.lower() in _SURVEYORS and given & {"x", "y"}:
            raise BadInputError(
                f"{head.place}: column {word!r}: in a surveyor's system X may point north and Y east, which is "
                "left-handed; name the columns E, N, H (east, north, height), or X, Y, Z of a right-handed system"
            )
        if column not in known:
            raise BadInputError(
                f"{head.place}: column {word!r} is not known (known: {', '.join(known)}); remove it or correct its name"
            )
        if columns.count(column) > 1:
            both = " and ".join(repr(other) for other, same in zip(words, columns, strict=True) if same == column)
            raise BadInputError(f"{head.place}: columns {both} are the same, {column}; remove all but one")
    label = _USUAL_COLUMNS[ending][0]
    if label not in columns:
        raise BadInputError(f"{head.place}: column {label!r} is missing; name it")
    return columns


def _check_count(row: Row, columns: Sequence[str], *, all_given: bool) -> None:
    """Refuse a line with other cells than the columns."""
    count = len(row.cells)
    if any(row.cells[len(columns) :]):
        raise BadInputError(
            f"{row.place}: {count} columns, but only {', '.join(columns)} are known; name them in the first line, "
            'write "..." around names with blanks or commas, and decimals with a point'
        )
    if all_given and count < len(columns):
        raise BadInputError(
            f"{row.place}: {count} cells instead of {len(columns)} ({', '.join(columns)}); separate them by "
            "semicolons, and leave empty ones empty"
        )


def _check_end(row: Row, most: int) -> None:
    """Refuse a line with more cells than there are columns, even empty ones: one separator is of a number or a name."""
    if len(row.cells) > most:
        raise BadInputError(
            f"{row.place}: {len(row.cells)} cells instead of {most}; name the columns in the first line, write "
            'decimals with a point, and "..." around names'
        )


def _check_unnamed(separator: str, words: Sequence[str], path: Path) -> None:
    """Refuse lines without named columns whose commas may be decimal ones, or where an empty cell would not be seen.

    Raises:
        BadInputError: the file can be read in two ways.
    """
    if separator == "," and not any("." in word for word in words):
        raise BadInputError(
            f"{path}: there is no decimal point, so commas may separate cells or be decimal ones; "
            "name the columns in the first line"
        )
    if separator == " " and path.suffix.lower() == ".csv":
        raise BadInputError(
            f"{path}: blanks separate the cells, so an empty one is not seen; name the columns in the first line, or "
            "separate them by semicolons"
        )


def _check_even(body: Sequence[Row], columns: Sequence[str]) -> None:
    """Refuse lines without named columns of which some have more cells: an empty one is not seen, a name may be two.

    Raises:
        BadInputError: two lines have different numbers of cells, and not because one has all sigmas, the other none.
    """
    counts = {len(row.cells) for row in body}
    if len(counts) > 1 and counts != {columns.index("sx"), len(columns)}:
        row = next(row for row in body if len(row.cells) != len(body[0].cells))
        raise BadInputError(
            f"{row.place}: {len(row.cells)} cells, and {len(body[0].cells)} in the first line: a cell may be empty, or "
            "a name be taken for two; name the columns in the first line, and leave empty cells between semicolons"
        )


def _check_sigmas(body: Sequence[Row], cells: Sequence[Mapping[str, str]]) -> None:
    """Refuse lines without named columns in which a sigma is so large beside another that it may be a coordinate."""
    for row, each in zip(body, cells, strict=True):
        sigmas = [_number(word) for name, word in each.items() if name in SIGMAS and is_number(word)]
        if len(sigmas) > 1 and max(sigmas) > _UNLIKE * min(sigmas) > 0.0:
            raise BadInputError(
                f"{row.place}: sigmas of {min(sigmas):g} and {max(sigmas):g}, of which one may be a coordinate behind "
                "a name of two cells; name the columns in the first line"
            )


def _check_blanks(body: Sequence[Row], columns: Sequence[str]) -> None:
    """Refuse lines separated by blanks, of which one that has not all cells has more than one blank at a place."""
    for row in body:
        if _WIDE.search(row.text) and len(row.cells) < len(columns):
            raise BadInputError(
                f"{row.place}: several blanks at one place, which may be an empty cell; name the columns in the first "
                "line, or separate the cells by semicolons"
            )


def _check_cameras(separator: str, body: Sequence[Row]) -> None:
    """Refuse cameras without named columns whose c may be the end of the name: c would be the principal point.

    Raises:
        BadInputError: the principal point is so far off that it may be c.
    """
    for row in body:
        name, c, behind = (*row.cells, "", "")[:3]
        if not is_number(c) or not is_number(behind) or abs(_number(behind)) < _FAR_MM:
            continue
        if c.isdecimal() or abs(_number(behind)) > _FAR_SHARE * abs(_number(c)):
            raise _may_be_one(name, c, separator, row)


def _number(word: str) -> float:
    return float(word.replace(",", "."))


def _check_first(separator: str, body: Sequence[Row], columns: Sequence[str], path: Path) -> None:
    """Refuse points without named columns whose first coordinate may be a part of the name, or a second name.

    With a name of two cells, two sigmas or none are three sigmas or one. Semicolons and tabs hardly stand in names, but
    the first column may number the lines.

    Raises:
        BadInputError: the first coordinate is a whole number and other cells say nothing about it.
    """
    behind = columns.index("name") + 1  # of image points the image stands before the name
    fewest = behind + 4  # cells that are too few for a longer name
    first = [row for row in body if len(row.cells) >= fewest and row.cells[behind].isdecimal()]
    sigmas = {row.cells[columns.index("sx") :] for row in body}
    alike = len(body) > 1 and len(sigmas) == 1 and all(next(iter(sigmas)))
    unsure = next((row for row in first if not _is_sure(row, behind, columns, alike=alike)), None)
    if unsure is None:
        return
    if separator in (" ", ","):
        raise _may_be_one(unsure.cells[behind - 1], unsure.cells[behind], separator, unsure)
    if len(first) == len(body):
        raise BadInputError(
            f"{path}: the column after the name holds whole numbers alone and may be no "
            "coordinate; name the columns in the first line"
        )


def _is_sure(row: Row, behind: int, columns: Sequence[str], *, alike: bool) -> bool:
    """Whether the first coordinate of a line, a whole number, is one: all are whole and no sigma is, or sx is sy.

    The sigmas have to be those of all lines, or one beside a name that does not look like a part of one.

    Args:
        row: the line.
        behind: place of the first coordinate.
        columns: of the file.
        alike: all lines have the same sigmas.
    """
    sigmas = row.cells[columns.index("sx") :]
    if any(map(_is_whole, sigmas)):
        return False
    if columns[0] == "image" and len(set(sigmas)) == 1 < len(sigmas):  # a coordinate and a sigma would differ
        return True
    name = row.cells[behind - 1]
    one = len(sigmas) == 1 and not (name.isalpha() or name.isdecimal())
    return (alike or one) and all(map(_is_whole, row.cells[behind : columns.index("sx")]))


def _is_whole(word: str) -> bool:
    return word.lstrip("+-").isdecimal()


def _check_names(separator: str, body: Sequence[Row]) -> None:
    """Refuse names that may go on in the next cell: "Ball 1" separated by blanks, "B,1" by commas.

    Raises:
        BadInputError: digits alone are beside a name of letters, or beside one of digits where other cells there are no
            whole numbers.
    """
    after = [row.cells[1] if len(row.cells) > 1 else "" for row in body]
    rarely = any(after) and not all(map(_is_whole, after))
    for row in body:
        name, more = row.cells[0], "".join(row.cells[1:2])
        if more.isdecimal() and (name.isalpha() or (name.isdecimal() and rarely)):
            raise _may_be_one(name, more, separator, row)
        second = "".join(row.cells[2:3])  # of image points, behind the image
        if more.isalpha() and second.isdecimal():
            raise _may_be_one(more, second, separator, row)


def _check_hidden(head: Row | None, body: Sequence[Row], columns: Sequence[str]) -> None:
    """Refuse lines in which blanks may hide an empty cell while a name of two words takes its place.

    Lines whose cells all stand below the words for their columns are aligned, and an empty cell would be seen.

    Raises:
        BadInputError: several blanks are at one place of a line, and elsewhere one blank separates a name from a cell
            that may belong to it, because it has no sign.
    """
    above = [] if head is None else [word.span() for word in _AFTER_MARK.finditer(head.text)]
    labels = [i for i, column in enumerate(columns) if column in _LABELS]
    beside = sorted({gap for i in labels for gap in (i - 1, i)}, reverse=True)  # gaps, by the cell before each
    for row in body:
        words = [word.span() for word in re.finditer(r"\S+", row.text)]
        if not _WIDE.search(row.text) or _is_aligned(words, above):
            continue
        for i in beside:
            pair = row.cells[max(i, 0) : i + 2]
            if len(pair) < 2 or words[i + 1][0] - words[i][1] > 1:
                continue
            quoted = any(cell != row.text[slice(*word)] for cell, word in zip(pair, words[i : i + 2], strict=True))
            if not quoted and not any(cell.startswith(("+", "-")) for cell in pair):
                raise _may_be_one(pair[0], pair[1], " ", row)


def _is_aligned(words: Sequence[tuple[int, int]], above: Sequence[tuple[int, int]]) -> bool:
    """Whether each word stands below that of its column; all given by their places, begin and end."""
    pairs = zip(words, above, strict=False)
    return len(words) == len(above) and all(start < right and left < end for (start, end), (left, right) in pairs)


def _may_be_one(name: str, more: str, separator: str, row: Row) -> BadInputError:
    one = f"{name}{separator}{more}"
    return BadInputError(
        f'{row.place}: {one!r} may be one name; separate the cells by semicolons, or write "..." around it'
    )


def _line(row: Row, cells: Mapping[str, str], points: Mapping[str, str], ending: str) -> Line:
    labels = {column: _label(word, row.place) for column, word in cells.items() if column in _LABELS}
    if _USUAL_COLUMNS[ending][0] not in labels:
        raise BadInputError(f"{row.place}: the name is missing; write {', '.join(_USUAL_COLUMNS[ending])}")
    values = {}
    for column, word in cells.items():
        if column not in _LABELS and (word or column not in SIGMAS):
            place = f"{row.place}, column {column}"
            if not word:
                raise BadInputError(f"{place}: the cell is empty; write a number")
            (values[column],) = numbers((points[word],), place)
    sigmas = [cells[column] for column in SIGMAS if column in cells]
    if any(sigmas) and not all(sigmas):
        raise BadInputError(f"{row.place}: a sigma is empty beside others; write it, or one column of sigmas for all")
    return Line(row.place, labels, values)


def _label(word: str, place: str) -> str:
    """A name as it stands in a cell."""
    if not word or not word.isprintable() or (word[0] in "'\u2018\u201c\u201e\u00ab`" and len(word) > 1):
        raise BadInputError(
            f'{place}: {word!r} is no name; write one, without quotes or with double ones ("...") around it'
        )
    return word
