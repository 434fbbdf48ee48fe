"""Skis that hide each other's edges: their axes by the edges that are seen and the width that skis of the jump have.

Where two skis lie side by side and overlap, an image shows one long thing. Its outer edges are measured well, but what
is between them is one brightness: how far the axes are apart, only the width of a ski tells. The fit estimates the
width together with the axes, but what it has of it may be little and wrong: a boot, a bent tip. The images of the same
jump in which the skis lie apart tell the width as well. It is learned for each camera, since a flat ski shows each of
them another width, and in metres, since the jumper comes nearer. Both count as they are sure: skis of a V, which look
differently wide, tell little about each other. The trace becomes what the fit would have found with that width: it
knows how its points depend on it (`Trace.one_sided`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.candidates.median import median
from analysis.candidates.model import Trace
from analysis.candidates.skis.axis_scatter import axis_scatter
from rig.arrays import Floats

_ALIKE = 0.5  # ratio of lengths, and of widths, of two skis that are both in sight
_FREE = 0.5  # median `one_sided` of a trace of which both edges are seen, at most
_FEWEST = 8  # traces that tell a width
_LEAST_SPREAD = 0.02  # of a width's logarithm, standard deviation: how well edges tell it
_FEWEST_POINTS = 3  # on an axis
_MAD_TO_SIGMA = 1.4826
_ONE_EDGE = np.sqrt(2.0)  # standard deviation of an edge's place, in those of the middle of two
_RESOLUTION = 1.0  # px; edges that are nearer to each other look like one
_UNRESOLVED = _RESOLUTION / np.sqrt(12.0)  # px, standard deviation of what may be anywhere within that
_SIGNIFICANT = 3.0  # standard deviations
_TWO = 2.0  # widths: two skis that hide no edge of each other


@dataclass(frozen=True, slots=True)
class SkiWidth:
    """The width that the skis of a jump show to a camera.

    Attributes:
        m: median.
        spread: standard deviation of its logarithm.
    """

    m: float
    spread: float

    @classmethod
    def of(cls, widths: Sequence[float]) -> "SkiWidth | None":
        """What clear traces with such widths, m, tell; None if they are too few."""
        if len(widths) < _FEWEST:
            return None
        logarithm = np.log(np.array(widths))
        middle = median(logarithm)
        spread = _MAD_TO_SIGMA * median(np.abs(logarithm - middle))
        return cls(float(np.exp(middle)), max(spread, _LEAST_SPREAD))


def clear_widths(traces: Sequence[Trace]) -> list[float]:
    """Widths, px, of the two skis of an image where they do not hide each other; none if it does not show two.

    Args:
        traces: of the place where the jumper is.
    """
    order = sorted(traces, key=lambda trace: -_length(trace))[:2]
    if len(order) < 2:
        return []
    one, two = order
    lengths, widths = sorted((_length(one), _length(two))), sorted((one.width, two.width))
    alike = one.contrast * two.contrast > 0 and lengths[0] > _ALIKE * lengths[1] and widths[0] > _ALIKE * widths[1]
    hidden = max(median(np.abs(trace.one_sided)) for trace in order)
    return [one.width, two.width] if alike and hidden < _FREE else []


def told_apart(traces: Sequence[Trace], px: float, spread: float) -> tuple[Trace, ...]:
    """The traces of an image as those of skis whose width is known.

    Points of which one edge is seen move by half of what the width was off. A single trace that is too wide becomes
    two. Any other one of another width has an edge that is not its own: its standard deviation grows by half of the
    difference.

    Args:
        traces: of an image.
        px: width of a ski there.
        spread: standard deviation of its logarithm.
    """
    found: list[Trace] = []
    for trace in traces:
        excess, sigma = (trace.width - px) / 2, spread * px / 2
        hidden = np.abs(trace.one_sided)
        wide = _SIGNIFICANT * spread < np.log(trace.width / px) < np.log(_TWO)
        if wide and median(hidden) < _FREE and np.count_nonzero(np.isfinite(trace.widening)) >= _FEWEST_POINTS:
            found += [_off(_one_of_two(trace, px, side), sigma) for side in (-1, 1)]
        else:
            foreign = abs(excess) * (1 - float(hidden.max()))
            found.append(_off(_given(trace, px, spread), float(np.sqrt(max(0.0, foreign**2 - sigma**2)))))
    return tuple(_resolved(found, i) for i in range(len(found)))


def _given(trace: Trace, px: float, spread: float) -> Trace:
    """A trace as if it had been fitted with what else is known of its width; each counts as it is sure.

    The error of the width is common to the points: it shifts the axis by their mean dependence, and turns it where they
    depend on it differently.

    Args:
        trace: as fitted.
        px: width of a ski there.
        spread: standard deviation of its logarithm.
    """
    trust = spread**2 / (spread**2 + trace.width_spread**2)  # in the fit
    width, left = trace.width**trust * px ** (1 - trust), float(np.sqrt(trust)) * trace.width_spread
    excess, sigma = (trace.width - width) / 2, left * width / 2
    share, weight = trace.one_sided, trace.sigma**-2
    along, across = _axes(trace)
    mean = float(weight @ share / weight.sum())
    place = (trace.xy - weight @ trace.xy / weight.sum()) @ along
    turned = sigma**2 * float((weight * place) @ share) ** 2 / float(weight @ place**2)
    return replace(
        trace,
        xy=trace.xy - excess * share[:, None] * across,
        sigma=trace.sigma * np.sqrt(1 + turned),
        common=_exchanged(trace.common, trace.of_width, mean * sigma),
        of_width=abs(mean * sigma),
        lasting=_exchanged(trace.lasting, trace.of_width, mean * sigma),
        ends=trace.ends - excess * mean * across,
        width=width,
        width_spread=left,
    )


def _exchanged(whole: float, before: float, after: float) -> float:
    """A standard deviation of which one part is another now."""
    return float(np.sqrt(max(0.0, whole**2 - before**2) + after**2))


def _one_of_two(trace: Trace, px: float, side: int) -> Trace:
    """One of two skis of known width that look like one: each edge of the trace is one of a ski's.

    Args:
        trace: of both.
        px: width of a ski.
        side: of which edge, -1 or 1 to the side (-y, x) of the trace's direction.
    """
    told = np.isfinite(trace.widening)
    along, across = _axes(trace)
    half, widening = (trace.width - px) / 2, trace.widening[told]
    aside = trace.one_sided[told] * widening + side * (half + widening)
    xy = trace.xy[told] + aside[:, None] * across
    sigma = _ONE_EDGE * trace.sigma[told]
    place = (xy - trace.ends[0]) @ along
    scatter = axis_scatter(place, (xy - trace.ends[0]) @ across, sigma, _length(trace))
    ends, one_sided = trace.ends + side * half * across, np.full(len(xy), -float(side))
    found = replace(
        trace, xy=xy, sigma=scatter.sigma, ends=ends, width=px, one_sided=one_sided, widening=np.full(len(xy), np.nan)
    )
    return _off(found, scatter.common)


def _resolved(traces: Sequence[Trace], i: int) -> Trace:
    """A trace with a larger standard deviation where another one is too near to be told from it.

    Where another trace ends too early, since a ski is as long as the other, its ski may go on, and be what is seen.
    """
    trace = traces[i]
    near, taken = np.zeros(len(trace.xy), bool), np.zeros(len(trace.xy), bool)
    for other in (other for k, other in enumerate(traces) if k != i):
        along, across = _axes(other)
        from_end, length = trace.xy - other.ends[0], _length(other)
        beside = np.abs(from_end @ across) < _RESOLUTION
        beyond = np.abs(from_end @ along - length / 2) - length / 2
        near |= beside & (beyond < 0)
        taken |= beside & (beyond >= 0) & (beyond < _length(trace) - length)
    near &= np.abs(trace.one_sided) > _FREE
    more = np.where(taken, _RESOLUTION, np.where(near, _UNRESOLVED, 0.0))
    sigma = np.hypot(trace.sigma, more)
    return _off(replace(trace, sigma=sigma), float(sigma**-2.0 @ more / (sigma**-2.0).sum()))


def _off(trace: Trace, more: float) -> Trace:
    """A trace that may be off by some px more, in neighbouring images too."""
    return replace(trace, common=float(np.hypot(trace.common, more)), lasting=float(np.hypot(trace.lasting, more)))


def _axes(trace: Trace) -> tuple[Floats, Floats]:
    along = (trace.ends[1] - trace.ends[0]) / _length(trace)
    return along, np.array((-along[1], along[0]))


def _length(trace: Trace) -> float:
    return float(np.hypot(*(trace.ends[1] - trace.ends[0])))
