"""Candidates for skis: long thin straight things, as rows of cross sections on a line.

Lines are found among the middles of the bars (`analysis.candidates.bars`) by a Hough transform and refined by robust
adjustment. Two skis that partly cover each other make one bar, which is wider: its upper edge belongs to one ski, its
lower edge to the other, each half a ski's width from its axis. Such a bar stands for two middles. Gaps (body, boots,
markers) may divide a line. A limb is not long enough for its width.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.candidates.background import Region
from analysis.candidates.bars import Bars, find_bars
from analysis.candidates.model import Trace
from rig.arrays import Flags, Floats, Integers

_SLENDER = 5.0  # length over width of a visible part, at least
_SHORTEST = 10  # columns
_LARGEST_WIDTH = 8  # widths of a ski that the larger side of the region measures at least
_STEEPEST = 1.05  # slope in the columns' direction; steeper lines are found in the transposed image
_WIDE = 1.3  # times the width of one ski: such a bar may be two
_TWO = 2.6  # times the width of one ski: two that just touch, and some blur
_TOLERANCE = 0.8  # px from the line of the Hough transform
_OUTLIER = 3.5  # sigmas
_LEAST_SIGMA = 0.05  # px; of a middle
_EDGE_SHIFT = 0.1  # px by which edges of a thin and of a wide bar appear at different places
_FILLED = 0.45  # share of the columns between the ends that has a bar
_GAP = 0.6  # share of the length that a body may hide in one piece
_MOST = 4  # lines of each sign and direction
_POINTS = 24  # of a trace
_ENDS = 0.05  # share of the length at each end that is not measured: tips are bent, tails are round


@dataclass(frozen=True, slots=True, eq=False)
class _Middles:
    """What may lie on an axis: one middle of a narrow bar, two of a wide one."""

    column: Integers
    row: Floats
    sigma: Floats
    width: Floats
    contrast: Floats
    split: Flags

    def only(self, chosen: Flags | Integers) -> "_Middles":
        return _Middles(
            self.column[chosen],
            self.row[chosen],
            self.sigma[chosen],
            self.width[chosen],
            self.contrast[chosen],
            self.split[chosen],
        )


def find_traces(region: Region) -> tuple[Trace, ...]:
    """Traces of a region, in px of the image, the longest first."""
    noise = float(np.median(region.sigma))
    widest = max(region.grey.shape) / _LARGEST_WIDTH
    found: list[Trace] = []
    for steep in (False, True):
        grey, front = (region.grey.T, region.front.T) if steep else (region.grey, region.front)
        bars = find_bars(grey, noise, front, widest)
        bars = bars.only(bars.front)
        for sign in (1, -1):
            traces = _lines(bars.only(np.sign(bars.contrast) == sign), grey.shape[0])
            found += [_turned(trace) if steep else trace for trace in traces]
    offset = np.array((region.x, region.y), float)
    found = _distinct(found)
    return tuple(replace(trace, xy=trace.xy + offset, ends=trace.ends + offset) for trace in found)


def _turned(trace: Trace) -> Trace:
    return replace(trace, xy=trace.xy[:, ::-1].copy(), ends=trace.ends[:, ::-1].copy())


def _distinct(traces: Sequence[Trace]) -> list[Trace]:
    """The longest first, without those that both directions found."""
    kept: list[Trace] = []
    for trace in sorted(traces, key=_length, reverse=True):
        if not any(_same(trace, other) for other in kept):
            kept.append(trace)
    return kept


def _length(trace: Trace) -> float:
    return float(np.hypot(*(trace.ends[1] - trace.ends[0])))


def _same(trace: Trace, other: Trace) -> bool:
    """Whether a trace lies on a longer one of the same sign."""
    along = (other.ends[1] - other.ends[0]) / _length(other)
    across = np.abs((trace.xy - other.ends[0]) @ np.array((-along[1], along[0])))
    return trace.contrast * other.contrast > 0 and bool(across.max() < _TOLERANCE)


def _lines(bars: Bars, rows: int) -> list[Trace]:
    """Traces of one sign and direction."""
    if len(bars.column) < _SHORTEST:
        return []
    plain = _Middles(
        bars.column,
        (bars.first + bars.last) / 2,
        np.hypot(bars.sigma / np.sqrt(2), _LEAST_SIGMA),
        bars.width,
        bars.contrast,
        np.zeros(len(bars.column), bool),
    )
    first = _best_line(plain, rows)
    if first is None:
        return []
    width = _single_width(plain.width[first[2]])
    left = _split(bars, width)
    traces: list[Trace] = []
    for _ in range(_MOST):
        line = _best_line(left, rows)
        if line is None:
            break
        offset, slope, on = line
        trace = _trace(left.only(on), offset, slope)
        if trace is not None:
            traces.append(trace)
        left = left.only(~on)
    return traces


def _single_width(widths: Floats) -> float:
    """Width of one ski among the widths of bars of which some may be two skis: the narrowest tenth, median."""
    narrow = np.sort(widths)[: max(5, len(widths) // 5)]
    return float(np.median(narrow))


def _split(bars: Bars, width: float) -> _Middles:
    wide = (bars.width > _WIDE * width) & (bars.width <= _TWO * width)
    narrow = bars.width <= _WIDE * width
    one, two = bars.only(narrow), bars.only(wide)
    sigma_two = np.hypot(two.sigma, _LEAST_SIGMA)
    return _Middles(
        np.concatenate((one.column, two.column, two.column)),
        np.concatenate(((one.first + one.last) / 2, two.first + width / 2, two.last - width / 2)),
        np.concatenate((np.hypot(one.sigma / np.sqrt(2), _LEAST_SIGMA), sigma_two, sigma_two)),
        np.concatenate((one.width, np.full(2 * len(two.column), width))),
        np.concatenate((one.contrast, two.contrast, two.contrast)),
        np.repeat((False, True), (len(one.column), 2 * len(two.column))),
    )


def _best_line(middles: _Middles, rows: int) -> tuple[float, float, Flags] | None:
    """The line with the most columns: row at column 0, slope, and which middles lie on it."""
    if len(middles.column) < _SHORTEST:
        return None
    x, y = middles.column.astype(float), middles.row
    start = float(x.min())
    extent = max(1.0, float(np.ptp(x)))
    slopes = np.linspace(-_STEEPEST, _STEEPEST, max(3, 2 * int(2 * _STEEPEST * extent) // 2 + 1))
    bins = rows + 2 * int(_STEEPEST * extent) + 4
    low = int(_STEEPEST * extent) + 1
    cell = np.floor(y[None, :] - slopes[:, None] * (x - start) + low).astype(int)
    votes = np.bincount((np.arange(len(slopes))[:, None] * bins + cell).ravel(), minlength=len(slopes) * bins)
    votes = votes.reshape(len(slopes), bins)
    pairs = votes[:, :-1] + votes[:, 1:]
    k, b = np.unravel_index(int(pairs.argmax()), pairs.shape)
    if pairs[k, b] < _SHORTEST * _FILLED:
        return None
    slope, offset = float(slopes[k]), float(b + 1 - low) - float(slopes[k]) * start
    return _refined(middles, offset, slope)


def _refined(middles: _Middles, offset: float, slope: float) -> tuple[float, float, Flags] | None:
    x, y = middles.column.astype(float), middles.row
    on = np.abs(y - offset - slope * x) < 2 * _TOLERANCE
    for limit in (1.2 * _TOLERANCE, _TOLERANCE, _TOLERANCE, _TOLERANCE):
        if np.count_nonzero(on) < 3:
            return None
        weight = 1 / middles.sigma[on] ** 2
        mean_x, mean_y = np.average(x[on], weights=weight), np.average(y[on], weights=weight)
        square = float(np.sum(weight * (x[on] - mean_x) ** 2))
        if square <= 0:
            return None
        slope = float(np.sum(weight * (x[on] - mean_x) * (y[on] - mean_y)) / square)
        offset = float(mean_y - slope * mean_x)
        on = np.abs(y - offset - slope * x) < limit
    return offset, slope, on


def _trace(on: _Middles, offset: float, slope: float) -> Trace | None:
    """The trace of the middles on a line; None if they are too few, too far apart, or the thing is too thick."""
    order = np.argsort(on.column)
    on = on.only(order)
    on = on.only(_main_run(on.column))
    across = 1 / np.hypot(1, slope)
    if len(on.column) < _SHORTEST:
        return None
    off = on.row - offset - slope * on.column
    scale = max(1.0, 1.4826 * float(np.median(np.abs(off) / on.sigma)))
    good = np.abs(off) < _OUTLIER * scale * on.sigma
    on, off = on.only(good), off[good]
    if len(on.column) < _SHORTEST:
        return None
    first, last = float(on.column[0]), float(on.column[-1])
    width = float(np.median(on.width)) * across
    length = (last - first + 1) / across
    filled = len(np.unique(on.column)) / (last - first + 1)
    if length < _SLENDER * width or filled < _FILLED:
        return None
    spare = max(width / 2, _ENDS * (last - first))
    inner = (on.column >= first + spare) & (on.column <= last - spare)
    if np.count_nonzero(inner) < 4:
        return None
    points = on.only(inner)
    xy, sigma = _grouped(points, scale)
    common = _EDGE_SHIFT * float(np.mean(points.split)) * across
    ends = np.array([(c, offset + slope * c) for c in (first, last)])
    return Trace(xy, sigma * across, common, ends, width, float(np.median(on.contrast)))


def _main_run(column: Integers) -> Flags:
    """Which of the sorted columns belong to the run with most of them; gaps up to a part of its length are bridged."""
    keep = np.ones(len(column), bool)
    while True:
        kept = column[keep]
        gaps = np.diff(kept)
        if not len(gaps) or gaps.max() <= max(3, _GAP * (kept[-1] - kept[0])):
            return keep
        k = int(gaps.argmax())
        where = np.flatnonzero(keep)
        keep[where[k + 1 :] if k + 1 >= len(kept) - k - 1 else where[: k + 1]] = False


def _grouped(points: _Middles, scale: float) -> tuple[Floats, Floats]:
    """At most so many points, each the weighted mean of neighbours."""
    groups = np.array_split(np.arange(len(points.column)), min(_POINTS, len(points.column)))
    xy, sigma = [], []
    for group in groups:
        weight = 1 / (scale * points.sigma[group]) ** 2
        total = float(weight.sum())
        xy.append((float(weight @ points.column[group]) / total, float(weight @ points.row[group]) / total))
        sigma.append(total**-0.5)
    return np.array(xy), np.array(sigma)
