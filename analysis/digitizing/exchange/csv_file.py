"""Marks as a table: one row for each mark, every state of it kept."""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.things import is_line
from photogrammetry.exchange.dialect import Row, read_rows, with_points
from photogrammetry.exchange.part import is_written_number
from rig.api.digitizing import Mark, MarkState
from rig.errors import BadInputError

#: Columns by the first words of their headings; places are px, (0, 0) is the centre of the top-left pixel.
_COLUMNS: Final = ("pulse", "camera", "thing", "vertex", "state", "x", "y", "sigma x", "sigma y", "source")
_UNITS: Final = {"x": "x (px)", "y": "y (px)", "sigma x": "sigma x (px)", "sigma y": "sigma y (px)"}
_NUMBERS: Final = frozenset(_UNITS)
_NOTHING: Final = ("", "")
_NEEDED: Final = ("pulse", "camera", "thing", "x", "y")
_PLACED: Final = frozenset({MarkState.MEASURED, MarkState.GUESS})


def csv_of(marks: Iterable[tuple[Key, Entered]]) -> bytes:
    """The table of marks, UTF-8, cells separated by commas, numbers with decimal points that give them back exactly."""
    text = io.StringIO()
    # Words in quotes, so that a semicolon in a name is not taken for a separator.
    writer = csv.writer(text, lineterminator="\r\n", quoting=csv.QUOTE_NONNUMERIC)
    writer.writerow([_UNITS.get(name, name) for name in _COLUMNS])
    for key, mark in marks:
        place, sigma = (_NOTHING if pair is None else tuple(map(float, pair)) for pair in (mark.xy, mark.sigma))
        vertex = "" if key.vertex < 0 else key.vertex
        row = [key.pulse, key.camera, key.thing, vertex, mark.state.value]
        writer.writerow([*row, *place, *sigma, mark.source.value])
    return text.getvalue().encode()


def read_csv(path: Path) -> list[tuple[Key, Entered]]:
    """Read a table of marks, as a spreadsheet may have saved it: commas, semicolons or tabs, decimal commas or points.

    Columns are found by their headings, in any order; more of them are left out. State, sigmas and source may be
    missing: then a mark with a place is measured by hand.

    Raises:
        BadInputError: a row says no mark, or two rows say one; or the numbers can be read in two ways.
    """
    table = read_rows(path)
    rows = [row for row in table.rows if not row.comment]
    if not rows:
        raise BadInputError(f"{path}: holds no rows; name a table of marks")
    places = _headings(rows[0])
    _check_counts(rows, table.separator)
    words = [
        row.cells[places[name]]
        for row in rows[1:]
        for name in _NUMBERS & places.keys()
        if places[name] < len(row.cells)
    ]
    numbers = with_points(words, table.separator, path)
    marks: dict[Key, Entered] = {}
    for row in rows[1:]:
        key, entered = _mark(row, places, numbers)
        if key in marks:
            raise BadInputError(
                f"{row.place}: {key.thing} at pulse {key.pulse} in {key.camera} stands twice; keep one row"
            )
        marks[key] = entered
    return list(marks.items())


def _headings(row: Row) -> dict[str, int]:
    """Place of each column by its name, without its unit."""
    found: dict[str, int] = {}
    for place, cell in enumerate(row.cells):
        name = " ".join(cell.split("(")[0].split("[")[0].lower().replace("_", " ").split())
        if name in _COLUMNS:
            if name in found:
                raise BadInputError(f"{row.place}: two columns are headed {name}; remove one")
            found[name] = place
    if missing := [name for name in _NEEDED if name not in found]:
        raise BadInputError(
            f"{row.place}: no column is headed {', '.join(missing)}; the headings of a table of marks are "
            f"{', '.join(_UNITS.get(name, name) for name in _COLUMNS)}"
        )
    return found


def _check_counts(rows: Sequence[Row], separator: str) -> None:
    """Refuse rows with more cells than headings; between commas also empty ones, between blanks also fewer.

    Raises:
        BadInputError: a decimal comma or a word may be taken for two cells, or blanks may hide an empty one.
    """
    count = len(rows[0].cells)
    for row in rows[1:]:
        more = row.cells[count:] if separator == "," else any(row.cells[count:])
        if more or (separator == " " and len(row.cells) < count):
            raise BadInputError(
                f"{row.place}: {len(row.cells)} cells below {count} headings; write decimals with a point, quotes "
                "around words with the separator, and semicolons between cells of which some are empty"
            )


def _mark(row: Row, places: Mapping[str, int], numbers: Mapping[str, str]) -> tuple[Key, Entered]:
    cells = {name: row.cells[place] for name, place in places.items() if place < len(row.cells) and row.cells[place]}
    xy, sigma = (_pair(row, cells, names, numbers) for names in (("x", "y"), ("sigma x", "sigma y")))
    fields = {name: cells[name].lower() for name in ("state", "source") if name in cells}
    try:
        mark = Mark.model_validate(
            {
                "pulse": _whole(row, cells.get("pulse", "")),
                "camera": cells.get("camera", ""),
                "thing": cells.get("thing", ""),
                "vertex": _whole(row, cells["vertex"]) if "vertex" in cells else None,
                "xy": xy,
                "sigma": sigma,
                **fields,
            }
        )
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(map(str, first["loc"]))
        raise BadInputError(f"{row.place}: {name}: {first['msg']}; correct it") from None
    if (mark.xy is not None) != (mark.state in _PLACED):
        wrong = "has a place" if mark.xy is not None else "has no place"
        raise BadInputError(f"{row.place}: {mark.thing} is {mark.state.value} and {wrong}; correct state or place")
    if (mark.vertex is not None) != (is_line(mark.thing) and mark.xy is not None):
        which = "needs a vertex, 0, 1, 2, ..." if mark.vertex is None else "has no vertices"
        raise BadInputError(f"{row.place}: {mark.thing} {which}; correct the vertex")
    key = Key(mark.pulse, mark.camera, mark.thing, -1 if mark.vertex is None else mark.vertex)
    return key, Entered(mark.state, mark.xy, mark.sigma, mark.source)


def _pair(
    row: Row, cells: Mapping[str, str], names: Sequence[str], numbers: Mapping[str, str]
) -> tuple[float, float] | None:
    given = [cells[name] for name in names if name in cells]
    if not given:
        return None
    if len(given) < len(names):
        raise BadInputError(f"{row.place}: give both, {' and '.join(names)}, or none of them")
    words = [numbers.get(word, word) for word in given]
    if not all(map(is_written_number, words)):
        raise BadInputError(f"{row.place}: {' and '.join(names)} are {' and '.join(given)}; write numbers")
    return float(words[0]), float(words[1])


def _whole(row: Row, word: str) -> int:
    if not (word.isascii() and word.isdecimal()):
        raise BadInputError(f'{row.place}: "{word}" is no whole number; correct pulse and vertex')
    return int(word)
