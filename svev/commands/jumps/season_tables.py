"""Rows of the tables of a season as lines for people."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, Final

from analysis.report.figures import decimals
from season.tables.comparison import Group

_SIGNIFICANT: Final = 6


def group_rows(found: Iterable[Group]) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Groups of jumps as columns and rows; numbers as numbers."""
    groups = list(found)
    columns = [*(groups[0].of if groups else ()), "jumps", "mean", "sigma_mean", "scatter"]
    columns += ["days", "difference", "sigma_difference", "p", "differs"]
    rows: list[tuple[Any, ...]] = [
        (
            *group.of.values(), group.jumps, *_rounded(group.mean, group.sigma_mean), _short(group.scatter), group.days,
            *_rounded(group.difference, group.sigma_difference), _short(group.p), "*" if group.differs else "",
        )
        for group in groups
    ]  # fmt: skip
    return columns, rows


def aligned(columns: Sequence[str], rows: Sequence[Sequence[Any]]) -> list[str]:
    """A table as lines, numbers at the right."""
    cells = [[_text(cell) for cell in row] for row in rows]
    widths = [max([len(name), *(len(row[at]) for row in cells)]) for at, name in enumerate(columns)]
    right = [any(isinstance(row[at], int | float) for row in rows) for at in range(len(columns))]
    return [
        "  ".join(cell.rjust(width) if of_numbers else cell.ljust(width)
                  for cell, width, of_numbers in zip(row, widths, right, strict=True)).rstrip()
        for row in [list(columns), *cells]
    ]  # fmt: skip


def _rounded(value: float | None, sigma: float | None) -> tuple[float | None, float | None]:
    if value is None or sigma is None or not math.isfinite(sigma):
        return _short(value), None
    places = decimals(sigma)
    return round(value, places), round(sigma, places)


def _short(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(f"{value:.3g}")


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    return f"{cell:.{_SIGNIFICANT}g}" if isinstance(cell, float) else str(cell)
