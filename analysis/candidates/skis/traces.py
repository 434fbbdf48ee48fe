"""Candidates for skis: long thin straight things, as rows of cross sections on a line.

Lines are found among the middles of the bars (`analysis.candidates.skis.bars`) by a Hough transform and refined by
robust adjustment. Two skis that partly cover each other make one bar, which is wider: its upper edge belongs to one
ski, its lower edge to the other, each half a ski's width from its axis. Such a bar stands for two middles. Gaps (body,
boots, markers) may divide a line. A limb is not long enough for its width. The lines, and two skis that nearly cover
each other, are then fitted to all pixels around them (`analysis.candidates.skis.ski_fit`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.candidates.foreground.background import Region
from analysis.candidates.median import median
from analysis.candidates.model import ExpectedSki, Trace
from analysis.candidates.skis.axis_scatter import axis_scatter
from analysis.candidates.skis.bar_model import Bar
from analysis.candidates.skis.bars import Bars, find_bars
from analysis.candidates.skis.corridors import Corridor, one_each
from analysis.candidates.skis.ski_fit import FittedBar, fit_bars
from rig.arrays import Flags, Floats, Integers

_SLENDER = 7.0  # length over width of a visible part, at least
_SHORTEST = 10  # columns
_LARGEST_WIDTH = 8  # widths of a ski that the larger side of the region measures at least
_STEEPEST = 1.05  # slope in the columns' direction; steeper lines are found in the transposed image
_WIDE = 1.3  # times the width of one ski: such a bar may be two
_TWO = 2.6  # times the width of one ski: two that just touch, and some blur
_TOLERANCE = 0.8  # px from the line of the Hough transform
_LEAST_SIGMA = 0.05  # px; of a middle
_FILLED = 0.45  # share of the columns between the ends that has a bar
_GAP = 0.6  # share of the length that a body may hide in one piece
_TOGETHER = 3  # lines that are fitted together, the longest ones
_MOST = 4  # lines of each sign and direction
_MISFIT = 4.0  # residuals over noise
_WORST_SIGMA = 0.5  # px; of a point
_FEWEST_POINTS = 3  # on an axis
_PARALLEL = 0.9  # cosine; lines that cross at more than that hardly disturb each other
_COVERING = 0.97  # cosine of the angle between skis that may nearly cover each other
_NARROWER = 0.75  # a ski's width over that of two which cover each other, to start from
_APART = 0.06  # share of their length by which two skis that cover each other may be apart at their ends
_POINTS = 24  # of a trace
_BOTH = 2  # skis
_ENDS = 0.05  # share of the length at each end that is not measured: tips are bent, tails are round
_OBLIQUE = 1.0  # likewise in widths: seen obliquely, one edge ends that much before the other


@dataclass(frozen=True, slots=True, eq=False)
class _Line:
    """A line that bars lie on: ends (2, 2) and width, px of the region; sign of the contrast."""

    ends: Floats
    width: float
    sign: int

    @property
    def length(self) -> float:
        """Length, px."""
        return float(np.hypot(*(self.ends[1] - self.ends[0])))


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


def find_traces(region: Region, expected: Sequence[ExpectedSki] = ()) -> tuple[Trace, ...]:
    """Traces of a region, in px of the image, the longest first.

    Args:
        region: part of an image.
        expected: skis that it may show. If lines are found where these may be, what is elsewhere is left out.
    """
    corridors = [Corridor.of(ski, (region.x, region.y)) for ski in expected]
    signs = sorted({corridor.sign for corridor in corridors}) or (1, -1)
    noise = median(region.noise)
    widest = max(region.grey.shape) / _LARGEST_WIDTH
    found: list[_Line] = []
    for steep in (False, True):
        if corridors and not any(corridor.leads(_STEEPEST, steep=steep) for corridor in corridors):
            continue
        grey, front = (region.grey.T, region.front.T) if steep else (region.grey, region.front)
        bars = find_bars(grey, noise, front, widest)
        bars = bars.only(bars.front)
        for sign in signs:
            lines = _lines(bars.only(np.sign(bars.contrast) == sign), grey.shape[0])
            found += [replace(line, ends=line.ends[:, ::-1].copy()) if steep else line for line in lines]
    lines = _distinct(found)
    if corridors:
        lines = [line for line in lines if any(corridor.holds(line.ends) for corridor in corridors)]
        if not lines:
            return find_traces(region)
    return _fitted(region, [(group, _starts(group, corridors)) for group in _groups(lines)])


def _starts(lines: Sequence[_Line], corridors: Sequence[Corridor]) -> list[list[Bar]]:
    """What lines near each other may be: two skis each may nearly cover each other where both are expected."""
    bars = _bars(lines)
    if corridors and one_each(corridors, [line.ends for line in lines]):
        return [bars]
    return _explanations(bars)


def find_expected_traces(region: Region, skis: Sequence[ExpectedSki]) -> tuple[Trace, ...]:
    """Traces of skis that are expected in a region, in px of the image, the longest first.

    The fit starts from where they are expected, which takes a fraction of the time of a search.
    """
    lines = [line for ski in skis if (line := _part_inside(ski, region)) is not None]
    if len(lines) == _BOTH and _covers(*lines):
        return _fitted(region, [(lines, [_bars(lines), _bars(lines[:1])])])
    return _fitted(region, [(group, [_bars(group)]) for group in _groups(lines)])


def _bars(lines: Sequence[_Line]) -> list[Bar]:
    return [Bar(line.ends, line.width) for line in lines]


def _fitted(region: Region, groups: Sequence[tuple[Sequence[_Line], list[list[Bar]]]]) -> tuple[Trace, ...]:
    """Traces of lines that are near each other, with what they may be; the longest first."""
    traces: list[Trace] = []
    for lines, starts in groups:
        fitted = fit_bars(region, starts, lines[0].sign > 0, _POINTS)
        traces += [trace for bar in fitted if (trace := _trace_of(bar, region)) is not None]
    return tuple(sorted(traces, key=lambda trace: -float(np.hypot(*(trace.ends[1] - trace.ends[0])))))


def _part_inside(ski: ExpectedSki, region: Region) -> _Line | None:
    """The part of an expected ski that lies in a region, in its px; None if it is too short to be measured."""
    begin, step = ski.ends[0] - (region.x, region.y), ski.ends[1] - ski.ends[0]
    size = np.array(region.grey.shape[::-1], float) - 1
    with np.errstate(divide="ignore", invalid="ignore"):
        borders = np.sort(np.stack((-begin, size - begin)) / step, axis=0)
    first, last = max(0.0, float(np.nanmax(borders[0]))), min(1.0, float(np.nanmin(borders[1])))
    line = _Line(begin + np.array((first, last))[:, None] * step, ski.width, 1 if ski.brighter else -1)
    return line if last > first and line.length > max(_SHORTEST, _SLENDER * ski.width) else None


def _covers(one: _Line, other: _Line) -> bool:
    """Whether two lines lie so near each other along half of the shorter one that they look like one."""
    short, long = sorted((one, other), key=lambda line: line.length)
    along = (long.ends[1] - long.ends[0]) / long.length
    from_end = short.ends[0] + np.linspace(0, 1, 15)[:, None] * (short.ends[1] - short.ends[0]) - long.ends[0]
    place, aside = from_end @ along, np.abs(from_end @ np.array((-along[1], along[0])))
    near = (place > 0) & (place < long.length) & (aside < (one.width + other.width) / 2)
    return bool(np.count_nonzero(near) > len(near) / 2)


def _explanations(bars: list[Bar]) -> list[list[Bar]]:
    """What one line or several near each other may be: these, or two skis that nearly cover each other."""
    longest = bars[0]
    along = (longest.ends[1] - longest.ends[0]) / longest.length
    found = [[longest, bar] for bar in bars[1:]] or [bars]
    if bars[1:] and all(abs(along @ (bar.ends[1] - bar.ends[0])) < _COVERING * bar.length for bar in bars[1:]):
        return found
    aside = np.array((-along[1], along[0])) * longest.width / 4
    shorter = along * _APART * longest.length
    for side in (1, -1):
        one = Bar(longest.ends + side * aside - np.array((np.zeros(2), shorter)), _NARROWER * longest.width)
        two = Bar(longest.ends - side * aside + np.array((shorter, np.zeros(2))), _NARROWER * longest.width)
        found.append([one, two])
    return found


def _trace_of(fitted: FittedBar, region: Region) -> Trace | None:
    """A fitted bar as a trace of the image; None if it is no ski."""
    bar = fitted.bar
    if fitted.misfit > _MISFIT or bar.length < max(_SHORTEST, _SLENDER * bar.width):
        return None
    along = (bar.ends[1] - bar.ends[0]) / bar.length
    t = (fitted.xy - bar.ends[0]) @ along
    spare = max(_OBLIQUE * bar.width, _ENDS * bar.length)
    inner = (t > spare) & (t < bar.length - spare) & (fitted.sigma < _WORST_SIGMA)
    if np.count_nonzero(inner) < _FEWEST_POINTS:
        return None
    offset = np.array((region.x, region.y), float)
    xy, sigma = fitted.xy[inner], fitted.sigma[inner]
    scatter = axis_scatter(t[inner], (xy - bar.ends[0]) @ np.array((-along[1], along[0])), sigma, bar.length)
    one_sided = np.clip(fitted.one_sided[inner], -1.0, 1.0)
    ends = bar.ends + offset
    return Trace(
        xy + offset,
        scatter.sigma,
        float(np.hypot(fitted.common, scatter.common)),
        ends,
        bar.width,
        fitted.contrast,
        one_sided,
        fitted.widening[inner],
        fitted.width_spread,
        fitted.of_width,
        float(np.hypot(fitted.lasting, scatter.common)),
    )


def _groups(lines: Sequence[_Line]) -> list[list[_Line]]:
    """Lines that are near enough to each other to disturb each other, together."""
    groups: list[list[_Line]] = []
    for line in lines:
        near = [group for group in groups if any(_near(line, other) for other in group)]
        groups = [group for group in groups if group not in near]
        groups.append([*(other for group in near for other in group), line])
    return [sorted(group, key=lambda line: -line.length)[:_TOGETHER] for group in groups]


def _near(line: _Line, other: _Line) -> bool:
    one, two = line.ends[1] - line.ends[0], other.ends[1] - other.ends[0]
    if line.sign != other.sign or abs(one @ two) < _PARALLEL * line.length * other.length:
        return False
    steps = np.linspace(0, 1, 15)[:, None]
    distance = np.hypot(*((line.ends[0] + steps * one)[:, None] - (other.ends[0] + steps * two)).transpose(2, 0, 1))
    step = max(line.length, other.length) / 28
    return bool(distance.min() < line.width + other.width + step)


def _distinct(lines: Sequence[_Line]) -> list[_Line]:
    """The longest first, without those that both directions found."""
    kept: list[_Line] = []
    for line in sorted(lines, key=lambda line: -line.length):
        if not any(_same(line, other) for other in kept):
            kept.append(line)
    return kept


def _same(line: _Line, other: _Line) -> bool:
    """Whether a line lies on a longer one of the same sign."""
    along = (other.ends[1] - other.ends[0]) / other.length
    across = np.abs((line.ends - other.ends[0]) @ np.array((-along[1], along[0])))
    return line.sign == other.sign and bool(across.max() < _TOLERANCE)


def _lines(bars: Bars, rows: int) -> list[_Line]:
    """Lines of one sign and direction."""
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
    lines: list[_Line] = []
    for _ in range(_MOST):
        line = _best_line(left, rows)
        if line is None:
            break
        offset, slope, on = line
        found = _line(left.only(on), offset, slope)
        if found is not None:
            lines.append(found)
        left = left.only(~on)
    return lines


def _single_width(widths: Floats) -> float:
    """Width of one ski among the widths of bars of which some may be two skis: the narrowest tenth, median."""
    narrow = np.sort(widths)[: max(5, len(widths) // 5)]
    return median(narrow)


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
    start = float(x.min() + x.max()) / 2
    extent = max(1.0, float(np.ptp(x)))
    slopes = np.linspace(-_STEEPEST, _STEEPEST, max(3, int(_STEEPEST * extent)))  # a px off at the ends, at most
    bins = rows + 2 * int(_STEEPEST * extent) + 4
    low = int(_STEEPEST * extent) + 1
    cell = (y + low) - slopes[:, None] * (x - start)  # never negative: cut off is rounded down
    cell += bins * np.arange(len(slopes))[:, None]
    votes = np.bincount(cell.astype(int).ravel(), minlength=len(slopes) * bins).reshape(len(slopes), bins)
    pairs = votes[:, :-1] + votes[:, 1:]
    k, b = np.unravel_index(int(pairs.argmax()), pairs.shape)
    if pairs[k, b] < _SHORTEST:
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
        total, u, v = float(weight.sum()), x[on], y[on]
        mean_u, mean_v = float(weight @ u) / total, float(weight @ v) / total
        square = float(weight @ (u - mean_u) ** 2)
        if square <= 0:
            return None
        slope = float(weight @ ((u - mean_u) * (v - mean_v))) / square
        offset = mean_v - slope * mean_u
        on = np.abs(y - offset - slope * x) < limit
    return offset, slope, on


def _line(on: _Middles, offset: float, slope: float) -> _Line | None:
    """The line of the middles on it; None if they are too few, too far apart, or the thing is too thick."""
    on = on.only(np.argsort(on.column))
    on = on.only(_main_run(on.column))
    if len(on.column) < _SHORTEST:
        return None
    first, last = float(on.column[0]), float(on.column[-1])
    width = median(on.width) / np.hypot(1, slope)
    length = (last - first + 1) * np.hypot(1, slope)
    filled = (1 + np.count_nonzero(np.diff(on.column))) / (last - first + 1)
    if length < _SLENDER * width or filled < _FILLED:
        return None
    ends = np.array([(c, offset + slope * c) for c in (first, last)])
    return _Line(ends, width, int(np.sign(on.contrast[0])))


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
