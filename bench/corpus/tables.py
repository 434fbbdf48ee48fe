"""Sums up the rows of a run of the corpus, and sets them beside those of the run before."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import msgspec
import numpy as np

from bench.corpus.judging import Row

#: Scenes that a rig for measurements would show: what the figures of the whole are asked of.
_LEAST_CAMERAS, _LEAST_WIDTH, _LEAST_MARKER_PX = 3, 640, 2.0
#: A difference of so many standard deviations between two runs on the same scenes is told.
_TOLD: Final = 2.0


class Sum(msgspec.Struct, frozen=True):
    """The figures of several scenes; None where there is nothing to count.

    Attributes:
        scenes: how many.
        figures: shares and root mean squares by name.
        sigmas: how well the figures are known, from the scatter between the scenes.
    """

    scenes: int
    figures: dict[str, float | None]
    sigmas: dict[str, float | None]


GROUPS: Final[dict[str, Callable[[Row], bool]]] = {
    "all": lambda _: True,
    "rigs for measurements": lambda row: (
        row.cameras >= _LEAST_CAMERAS and row.width >= _LEAST_WIDTH and row.marker_px >= _LEAST_MARKER_PX
    ),
    "pictures of the simulated hill": lambda row: row.renderer == "hill",
    "drawn pictures": lambda row: row.renderer == "drawn",
    "path-traced pictures": lambda row: row.renderer == "path-traced",
}

#: By name: of each scene what is counted, and out of how much.
_SHARES: Final[dict[str, Callable[[Row], tuple[float, float]]]] = {
    "analyzed": lambda row: (not row.error, 1),
    "cameras oriented": lambda row: (row.oriented, row.cameras),
    "jump found": lambda row: (row.jumps == 1, 1),
    "measured well": lambda row: (row.well, 1),
    "wrong though measured well": lambda row: (row.well and row.wrong + row.skis_wrong > 0, row.well),
    "points solved": lambda row: (row.solved, row.points),
    "points wrong": lambda row: (row.wrong, max(row.solved, 1)),
    "controlled points beyond 4 sigma": lambda row: (row.beyond, row.controlled),
    "skis solved": lambda row: (row.skis_solved, row.skis),
    "skis wrong": lambda row: (row.skis_wrong, row.skis_solved),
    "CPU-s": lambda row: (row.cpu_s, 1),
}
_QUANTITIES: Final = ("points", "alpha", "beta", "gamma", "dphi", "phi", "height", "speed")


def summed(rows: Sequence[Row]) -> Sum:
    """The figures of these scenes."""
    figures: dict[str, float | None] = {}
    sigmas: dict[str, float | None] = {}
    for name, of in _SHARES.items():
        figures[name], sigmas[name] = _ratio([of(row) for row in rows])
    figures["poses"], sigmas["poses"] = _root(*_ratio([row.pose for row in rows]))
    for part in ("raw", "smoothed"):
        for quantity in _QUANTITIES:
            pairs = [_all_phases(row, part, quantity) for row in rows]
            figures[f"{part} {quantity}"], sigmas[f"{part} {quantity}"] = _root(*_ratio(pairs))
    return Sum(len(rows), figures, sigmas)


def table(rows: Sequence[Row], before: dict[str, Any] | None) -> list[str]:
    """The figures of each group as lines of text.

    Args:
        rows: of this run.
        before: by group, the `Sum` of the run before as JSON; None: there is none.
    """
    lines = []
    for group, belongs in GROUPS.items():
        of_group = [row for row in rows if belongs(row)]
        lines += ["", f"{group}: {len(of_group)} scenes"]
        now = summed(of_group)
        old = None if before is None or group not in before else msgspec.convert(before[group], Sum)
        lines += [_line(name, now, old) for name, value in now.figures.items() if value is not None]
    lines += ["", "poses, raw and smoothed: root mean square of error over sigma, which should be 0.8 to 1.2"]
    return lines


def _line(name: str, now: Sum, old: Sum | None) -> str:
    value, sigma = now.figures[name], now.sigmas[name]
    line = f"  {name:34}{value:9.3f}" + (f" ± {sigma:.3f}" if sigma is not None else "")
    was = None if old is None else old.figures.get(name)
    if was is None or value is None:
        return line
    told = "" if old is None or not _differs(value, sigma, was, old.sigmas.get(name)) else "  <- differs"
    return f"{line:58}before {was:9.3f}{told}"


def _differs(value: float, sigma: float | None, was: float, was_sigma: float | None) -> bool:
    return abs(value - was) > _TOLD * math.hypot(sigma or 0.0, was_sigma or 0.0)


def _all_phases(row: Row, part: str, quantity: str) -> tuple[float, float]:
    """Sum of the squares of a quantity over all phases, and their number."""
    found = [of for key, of in row.squares.items() if key.startswith(part) and key.rpartition(" ")[2] == quantity]
    return sum(square for _, square in found), sum(count for count, _ in found)


def _ratio(pairs: Sequence[tuple[float, float]]) -> tuple[float | None, float | None]:
    """The sum of the first numbers over that of the second ones, and its standard deviation (ratio estimator)."""
    count, of = np.array(pairs, float).reshape(-1, 2).T
    total = float(of.sum())
    if not total:
        return None, None
    ratio = float(count.sum()) / total
    several = len(count)
    if several < 2:
        return ratio, None
    off = count - ratio * of
    return ratio, float(np.sqrt(several / (several - 1) * np.sum(off**2))) / total


def _root(mean: float | None, sigma: float | None) -> tuple[float | None, float | None]:
    """Root of a mean square, with its standard deviation."""
    if mean is None:
        return None, None
    root = math.sqrt(mean)
    return root, None if sigma is None or not root else sigma / (2 * root)
