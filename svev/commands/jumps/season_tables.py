"""Rows of the tables of a season as lines for people."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, Final

from analysis.report.figures import decimals
from season.tables.comparison import Group
from season.tables.mixed_effects import MixedEffects

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


def effect_lines(found: MixedEffects, unit: str) -> list[str]:
    """Effects of athletes and hills as lines."""
    mean, sigma = _rounded(found.mean.value, found.mean.sigma)
    rows = [
        (kind, effect.name, effect.jumps, *_rounded(effect.value, effect.sigma), "*" if effect.is_large else "")
        for kind, effects in (("athlete", found.athletes), ("hill", found.hills))
        for effect in effects
    ]
    parts = f"athletes {found.sd_athletes:.2g}, days {found.sd_days:.2g}, jumps of one athlete on one day"
    return [
        f"{found.jumps} jumps; mean of the athletes on {found.first_hill}: {mean} +- {sigma} {unit}",
        f"standard deviations: {parts} {found.sd_rest:.2g} {unit}; measurement alone {found.sigma:.2g} {unit}",
        *aligned(["", "name", "jumps", "effect", "sigma", ""], rows),
    ]


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
    return round(value, places) + 0.0, round(sigma, places)  # + 0.0: no minus before a zero


def _short(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(f"{value:.3g}")


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    return f"{cell:.{_SIGNIFICANT}g}" if isinstance(cell, float) else str(cell)
