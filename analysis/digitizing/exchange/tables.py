"""Tables of numbers as other digitizers write them."""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from rig.arrays import Floats
from rig.errors import BadInputError
from rig.settings.strict_toml import read_bytes

#: A sparse file may claim so many cells at most, so that no file can use up the memory.
_CELLS_MAX = 20_000_000


def table(headings: Sequence[str] | None, values: Floats, separator: str = ",") -> bytes:
    """Numbers (rows, columns) with all their digits, below their headings; what is not known is NaN."""
    text = io.StringIO()
    if headings is not None:
        text.write(separator.join(headings) + "\n")
    for row in values:
        text.write(separator.join("NaN" if np.isnan(number) else repr(float(number)) for number in row) + "\n")
    return text.getvalue().encode()


def read_matrix(path: Path) -> tuple[list[str], Floats]:
    """The headings of a table, and the numbers below them, (rows, columns); NaN where there are none.

    A name that ends in `.tsv` is that of a sparse table: headings, a line with the numbers of rows, columns and
    entries, then row, column (both from 1) and value, separated by tabs; 0 means that there is none.

    Raises:
        BadInputError: missing, unreadable, or no such table.
    """
    text = read_bytes(path, "CSV", "an existing file").decode("utf-8-sig", "replace")
    first, *lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    sparse = path.name.endswith(".tsv")
    separator = "\t" if sparse else ","
    headings = [heading.strip().strip('"') for heading in first.strip().split(separator)]
    try:
        rows = [[_number(word) for word in line.split(separator)] for line in lines if line.strip()]
        values = np.array(rows, float)
    except ValueError as error:
        raise BadInputError(
            f"{path}: is no table of numbers below a line of headings ({error}); save it with commas and decimal points"
        ) from None
    if values.ndim != 2:
        raise BadInputError(f"{path}: holds no rows; name a file with points")
    return headings, _dense(path, values) if sparse else values


def _number(word: str) -> float:
    word = word.strip()
    if "_" in word:  # Python's own way to write 1000 as 1_000
        raise ValueError(f"{word!r} is no number")
    return float(word) if word else np.nan


def _dense(path: Path, entries: Floats) -> Floats:
    whole = entries.shape[1] == 3 and bool((np.abs(entries[:, :2]) <= _CELLS_MAX).all())
    rows, columns = entries[0, :2].astype(int).tolist() if whole else (-1, -1)
    if not (rows > 0 and columns > 0 and rows * columns <= _CELLS_MAX):
        raise BadInputError(f"{path}: is no sparse table of DLTdv; save the points again")
    places = entries[1:, :2].astype(int) - 1
    if ((places < 0) | (places >= (rows, columns))).any():
        raise BadInputError(
            f"{path}: has entries outside of its {rows} rows and {columns} columns; save the points again"
        )
    dense = np.full((rows, columns), np.nan)
    dense[tuple(places.T)] = np.where(entries[1:, 2] == 0, np.nan, entries[1:, 2])
    return dense
