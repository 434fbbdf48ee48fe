"""Finds a ski again that was marked in an image: by the bar that lies along its mark, wherever it goes next.

The search is that of the automatic measurement: what is in front of the static scene, and in it long thin straight
things with two edges. The mark says which of them is the ski, and from then on the ski itself how wide it is.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.candidates.foreground.background import Background, Region
from analysis.candidates.model import ExpectedSki, Trace
from analysis.candidates.skis.traces import find_expected_traces, find_traces
from analysis.scene.static_image import StaticImage
from rig.arrays import Floats
from rig.errors import NoFitError
from rig.images.picture import Grey

#: A click is at most so far beside the axis, px, as in `fit_judgement`.
_CLICK_PX: Final = 4.0
#: Standard deviation of how fast a ski turns beside its turn until now, rad/s: skis are turned to the wind in 0.2 s.
_TURN_RAD_S: Final = 1.5
#: Standard deviation of how its binding is predicted, px.
_PLACE_PX: Final = 1.0
_MARGIN_PX: Final = 24
#: Sigmas of the prediction within which a ski must lie: one in a thousand does not.
_GATE: Final = 3.29
#: Sigmas by which the next bar must lie farther off, if another ski is not to be taken for this one.
_RIVAL: Final = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class SeenSki:
    """A ski in an image.

    Attributes:
        xy: (2, 2) px, two points of its axis such that their errors are independent.
        sigma: standard deviation of each across the axis, px.
        ends: (2, 2) px, where it visibly ends.
        width: px.
        brighter: than what is behind it.
    """

    xy: Floats
    sigma: float
    ends: Floats
    width: float
    brighter: bool


class SkiFinder:
    """Finds skis in the images of one recording.

    Args:
        static: the static image of each camera.
        rate_hz: pulses per second.
    """

    def __init__(self, static: Mapping[str, StaticImage], rate_hz: float) -> None:
        self._backgrounds = {name: Background(image) for name, image in static.items()}
        self._rate_hz = rate_hz

    def marked(self, camera: str, image: Grey, vertices: Floats) -> SeenSki:
        """The ski that was marked by points (k, 2) along it, px.

        Raises:
            NoFitError: no bar lies along the mark.
        """
        traces = [trace for region in self._around(camera, image, vertices) for trace in find_traces(region)]
        along = [trace for trace in traces if _aside(trace.xy, vertices) < _CLICK_PX and _overlaps(trace, vertices)]
        if not along:
            raise NoFitError(f"{camera}: no bar lies along the ski that was marked")
        return _seen(min(along, key=lambda trace: _aside(trace.xy, vertices)))

    def again(
        self, camera: str, image: Grey, known: SeenSki, step: Floats, pulses: int = 1, other: Floats | None = None
    ) -> SeenSki:
        """A ski that was seen some pulses ago and has gone by `step` since.

        Args:
            camera: that shows it.
            image: (rows, columns) its frame.
            known: the ski when it was seen last.
            step: (2,) px, how far it has gone.
            pulses: since then.
            other: (2, 2) px, where the other ski should be; a bar nearer to that is not taken.

        Raises:
            NoFitError: it is not to be seen there, or two bars may be it.
        """
        ends = known.ends + step
        half = float(np.hypot(*(ends[1] - ends[0]))) / 2
        sigma = float(np.hypot(_PLACE_PX, _TURN_RAD_S * pulses / self._rate_hz * half))
        expected = ExpectedSki(ends, known.width, known.brighter, sigma)
        traces: list[Trace] = []
        for region in self._around(camera, image, ends):
            traces += find_expected_traces(region, [expected]) if expected.near else ()
            traces += find_traces(region, [expected])
        there = [
            (_aside(trace.xy, ends), trace)
            for trace in traces
            if _alike(trace, known)
            and _aside(trace.xy, ends) < _GATE * sigma
            and (other is None or _aside(trace.xy, ends) < _aside(trace.xy, other))
        ]
        if not there:
            raise NoFitError(f"{camera}: the ski is not to be seen where it should be")
        nearest = min(there, key=lambda each: each[0])
        rivals = [
            trace
            for off, trace in there
            if off - nearest[0] < _RIVAL * sigma and _aside(trace.xy, nearest[1].ends) > known.width / 2
        ]
        if rivals:
            raise NoFitError(f"{camera}: two bars may be the ski")
        return _seen(nearest[1])

    def _around(self, camera: str, image: Grey, places: Floats) -> Sequence[Region]:
        low = np.maximum(np.floor(places.min(axis=0)).astype(int) - _MARGIN_PX, 0)
        high = np.minimum(np.ceil(places.max(axis=0)).astype(int) + _MARGIN_PX + 1, image.shape[::-1])
        if camera not in self._backgrounds or (high <= low).any():
            raise NoFitError(f"{camera}: the ski is outside of the image")
        box = int(low[0]), int(low[1]), int(high[0]), int(high[1])
        return self._backgrounds[camera].regions(image, None, box)


def _seen(trace: Trace) -> SeenSki:
    xy, sigma = as_two_points(trace.xy, trace.sigma, trace.common)
    return SeenSki(xy, sigma, trace.ends, trace.width, trace.contrast > 0)


def as_two_points(xy: Floats, sigma: Floats, common: float) -> tuple[Floats, float]:
    """Two points of a line that say as much of its place and turn as the points that were measured along it.

    They lie at the root mean square distance of the points from their centre. The error that all points share counts
    fully in each.

    Args:
        xy: (k, 2) px.
        sigma: (k,) standard deviations across the line, px.
        common: standard deviation of the error across the line that all points share, px.

    Returns:
        The points (2, 2), px, and the standard deviation of each across the line, independent of the other's.
    """
    begin, end = _outer(xy)
    axis = (end - begin) / np.hypot(*(end - begin))
    across = np.array((-axis[1], axis[0]))
    weight = np.asarray(sigma, float) ** -2.0
    centre = (weight[:, None] * xy).sum(axis=0) / weight.sum()
    along, aside = (xy - centre) @ axis, (xy - centre) @ across
    direction = axis + (weight * along * aside).sum() / (weight * along**2).sum() * across
    direction = direction / np.hypot(*direction)
    reach = float(np.sqrt((weight * along**2).sum() / weight.sum()))
    places = centre + np.array(((-reach,), (reach,))) * direction
    return places, float(np.sqrt(2 / weight.sum() + 2 * common**2))


def _aside(xy: Floats, line: Floats) -> float:
    """How far points (k, 2) lie from the line through the outer ones of (n, 2) at most, px."""
    begin, end = _outer(line)
    axis = (end - begin) / np.hypot(*(end - begin))
    return float(np.abs((xy - begin) @ np.array((-axis[1], axis[0]))).max())


def _overlaps(trace: Trace, line: Floats) -> bool:
    """Whether a trace covers at least half of what was marked, or is covered by it."""
    begin, end = _outer(line)
    length = float(np.hypot(*(end - begin)))
    along = np.sort((trace.ends - begin) @ (end - begin) / length)
    common = min(along[1], length) - max(along[0], 0.0)
    return bool(common > min(length, along[1] - along[0]) / 2)


def _outer(line: Floats) -> tuple[Floats, Floats]:
    away = np.linalg.norm(line[:, None] - line[None], axis=2)
    i, j = np.unravel_index(away.argmax(), away.shape)
    return line[min(i, j)], line[max(i, j)]


def _alike(trace: Trace, known: SeenSki) -> bool:
    """Whether a trace may be the ski: its contrast has the same sign and its width is not another one's."""
    return (trace.contrast > 0) == known.brighter and abs(np.log(trace.width / known.width)) < np.log(2.0)
