"""Refines clicks on an edge to their feet on it, and clicks along a ski to its axis."""

from dataclasses import dataclass

import cv2
import numpy as np

from analysis.candidates.skis.bar_model import MODEL
from analysis.digitizing.tracking.edge_profiles import REACH_PX, Borders, Strip, fit_borders, strip, unexplained
from analysis.digitizing.tracking.fit_judgement import (
    NEAR_PX,
    TRIED,
    inside,
    is_poor,
    is_significant,
    noise_around,
    part_around,
)
from rig.arrays import Floats
from rig.errors import NoFitError
from rig.images.picture import Grey

_EDGE_HALF = 5.0  # px along an edge that are fitted, to either side
_WIDTHS = (1.5, 2.5, 4.0)  # px to the other edge of a bar, to start from
_BAR_HALF_WIDTHS = 0.75 * 1.5 ** np.arange(6)  # px
_SHIFTS = np.arange(-NEAR_PX, NEAR_PX + 0.5, 1.0)  # px, of either end of a line to start from
_SECTIONS_TO_START = 8  # with which starts are compared
_DIFFERENT = 1.0  # px; starts that differ by less lead to the same fit
_WORST_PX = 1.0  # sigma of a border


@dataclass(frozen=True, slots=True, eq=False)
class RefinedEdge:
    """A place on an edge.

    Attributes:
        xy: (2,) foot of the click on the edge, px.
        sigma: standard deviation across the edge, px.
        direction: (2,) unit vector along the edge.
    """

    xy: Floats
    sigma: float
    direction: Floats


@dataclass(frozen=True, slots=True, eq=False)
class RefinedLine:
    """Points on the axis of a bar.

    Attributes:
        xy: (k, 2) px, one for each vertex that was given.
        sigma: (k,) standard deviations across the axis, px, such that k independent points say as much as the fit.
        width: (k,) of the bar there, px.
        edges: how many of its edges were fitted, 2 or 1.
    """

    xy: Floats
    sigma: Floats
    width: Floats
    edges: int


def refine_edge(image: Grey, xy: Floats, direction: Floats | None = None) -> RefinedEdge:
    """The edge at a click.

    Args:
        image: (rows, columns) grey values.
        xy: (2,) the click, px: at most `NEAR_PX` beside the edge.
        direction: (2,) along the edge, of any length; that of the strongest edge near the click if left out.

    Raises:
        NoFitError: there is no straight edge; the message says why.
    """
    xy = inside(image, xy, "edge")
    noise = noise_around(image, xy)
    along = _direction(image, xy) if direction is None else np.asarray(direction, float)
    along = along / np.hypot(*along)
    pixels = strip(image, xy - _EDGE_HALF * along, xy + _EDGE_HALF * along, NEAR_PX + max(_WIDTHS) + REACH_PX)
    reason = "nothing straight within 4 px of the click"
    for u in sorted(_steps(pixels), key=abs):
        pairs = [np.sort((u, u + aside))[:, None] * (1.0, 1.0) for width in _WIDTHS for aside in (-width, width)]
        for starts in ([np.full((1, 2), u)], pairs):  # a thin bar has another edge beside this one
            fitted = [borders for start in starts if (borders := fit_borders(pixels, start, noise)) is not None]
            found = [
                (borders, k) for borders in fitted for k in range(len(borders.ends)) if _off(borders, k) <= NEAR_PX
            ]
            reasons = [_why_poor(borders, noise) for borders, _ in found]
            sound = [each for each, why in zip(found, reasons, strict=True) if why is None]
            if sound:
                return _foot(pixels, *min(sound, key=lambda each: _off(*each)), xy)
            reason = next((why for why in reasons if why is not None), reason)
    raise NoFitError(f"no edge here: {reason}; click nearer to it, or measure by hand")


def refine_line(image: Grey, vertices: Floats, width: Floats | None = None) -> RefinedLine:
    """The axis of a bar, such as a ski, from places clicked along it or along one of its edges.

    Args:
        image: (rows, columns) grey values.
        vertices: (k, 2) px, k >= 2, at most `NEAR_PX` beside the axis.
        width: (k,) of the bar there, px, if it is known: then one edge is enough.

    Raises:
        NoFitError: there is no straight bar; the message says why.
    """
    vertices = np.asarray(vertices, float)
    if vertices.ndim != 2 or vertices.shape[1:] != (2,) or len(vertices) < 2:
        raise NoFitError("no line here: a line needs two places along it; click once more")
    start, end = _farthest(vertices)
    for vertex in (start, end):
        inside(image, vertex, "line")
    if np.hypot(*(end - start)) < 4 * NEAR_PX:
        raise NoFitError(f"no line here: its ends are nearer than {4 * NEAR_PX:.0f} px; click places farther apart")
    noise = noise_around(image, (start + end) / 2)
    pixels = strip(image, start, end, NEAR_PX + float(_BAR_HALF_WIDTHS[-1]) + REACH_PX)
    t = (vertices - start) @ pixels.along / pixels.length
    borders = _best_bar(pixels, noise)
    reason = "nothing straight with two edges along it" if borders is None else _why_poor(borders, noise)
    if borders is not None and reason is None:
        middle = np.array(((0.5, 0, 0.5, 0), (0, 0.5, 0, 0.5)))
        both = (borders.ends[0] + borders.ends[1]) / 2
        covariance = middle @ borders.covariance @ middle.T
        wide = borders.ends[1] - borders.ends[0]
        return _on_axis(pixels, t, both, covariance, wide[0] + (wide[1] - wide[0]) * t, 2)
    if width is not None:
        half = np.interp((0.0, 1.0), np.sort(t), np.asarray(width, float)[np.argsort(t)]) / 2
        single = _best_edge(pixels, half, noise)
        if single is not None and _why_poor(single[0], noise) is None:
            edge, side = single
            return _on_axis(pixels, t, edge.ends[0] + side * half, edge.covariance, np.asarray(width, float), 1)
    raise NoFitError(f"no line here: {reason}; click nearer to its axis, or measure by hand")


def _why_poor(borders: Borders, noise: float) -> str | None:
    """What speaks against fitted borders, in words; None: nothing."""
    if not is_significant(borders.explained, borders.unknowns):
        return "the contrast is that of noise"
    if not all(is_significant(float(evidence), borders.sections) for evidence in borders.evidence):
        return "an edge is not seen"
    model = MODEL * float(borders.step.max())
    if is_poor(borders.square * noise**2 / (noise**2 + model**2), borders.redundancy):
        ratio = np.sqrt(borders.square * noise**2 / borders.redundancy / (noise**2 + model**2))
        return f"the fit is poor, its residuals are {ratio:.1f} times those of noise and model"
    worst = float(np.sqrt(np.diagonal(borders.covariance).max()))
    if worst > _WORST_PX:
        return f"an edge is not determined, its sigma is {worst:.1f} px"
    return None


def _direction(image: Grey, xy: Floats) -> Floats:
    """Along the strongest edge near a place: the eigenvector of the structure tensor with the smaller eigenvalue."""
    part, corner = part_around(image, xy, _EDGE_HALF + NEAR_PX)
    grey = cv2.GaussianBlur(np.asarray(part, np.float32), (0, 0), 1.0, borderType=cv2.BORDER_REPLICATE)
    gy, gx = np.gradient(grey)
    y, x = np.mgrid[: grey.shape[0], : grey.shape[1]]
    weight = np.exp(-((x + corner[0] - xy[0]) ** 2 + (y + corner[1] - xy[1]) ** 2) / (2 * NEAR_PX**2))
    tensor = np.array([[(weight * a * b).sum() for a in (gx, gy)] for b in (gx, gy)])
    return np.asarray(np.linalg.eigh(tensor)[1][:, 0])


def _steps(pixels: Strip) -> list[float]:
    """Where the largest steps across a strip are within the reach of a click, their u, px, two at most."""
    u = np.arange(-NEAR_PX - 0.5, NEAR_PX + 0.75, 0.5)
    there, grey = pixels.there.ravel() > 0, pixels.grey.ravel()
    place, grey = pixels.u.ravel()[there], grey[there]
    steps = np.zeros(len(u))
    for i, at in enumerate(u):
        right, left = (place > at) & (place < at + 1.5), (place < at) & (place > at - 1.5)
        if right.any() and left.any():
            steps[i] = abs(grey[right].mean() - grey[left].mean())
    peaks = np.flatnonzero((steps[1:-1] >= steps[:-2]) & (steps[1:-1] >= steps[2:])) + 1
    return [float(u[i]) for i in peaks[np.argsort(-steps[peaks])][:2]]


def _off(borders: Borders, k: int) -> float:
    """How far a border lies from the click, px."""
    return abs(float(borders.ends[k].mean()))


def _foot(pixels: Strip, borders: Borders, k: int, xy: Floats) -> RefinedEdge:
    a, b = pixels.point(np.array((0.0, 1.0)), borders.ends[k])
    along = (b - a) / np.hypot(*(b - a))
    foot = a + along * float((xy - a) @ along)
    t = float((foot - pixels.start) @ pixels.along) / pixels.length
    by_ends = np.array((1 - t, t))
    own = borders.covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2]
    return RefinedEdge(foot, float(np.sqrt(by_ends @ own @ by_ends)), along)


def _farthest(vertices: Floats) -> tuple[Floats, Floats]:
    """The two vertices that lie farthest apart, in their order."""
    apart = np.hypot(*(vertices[:, None] - vertices).transpose(2, 0, 1))
    i, j = sorted(np.unravel_index(int(apart.argmax()), apart.shape))
    return vertices[i], vertices[j]


def _best_bar(pixels: Strip, noise: float) -> Borders | None:
    """The bar that explains most, from all starts near the clicks."""
    starts = [
        np.array(((a - half, b - half), (a + half, b + half)))
        for a in _SHIFTS
        for b in _SHIFTS
        for half in _BAR_HALF_WIDTHS
    ]
    return _best_of(pixels, starts, noise)


def _best_edge(pixels: Strip, half: Floats, noise: float) -> tuple[Borders, int] | None:
    """The edge that explains most, and on which side of it the axis lies: 1, larger u, or -1."""
    best: tuple[Borders, int] | None = None
    for side in (-1, 1):
        found = _best_of(pixels, [(np.array((a, b)) - side * half)[None] for a in _SHIFTS for b in _SHIFTS], noise)
        if found is not None and (best is None or found.explained > best[0].explained):
            best = found, side
    return best


def _best_of(pixels: Strip, starts: list[Floats], noise: float) -> Borders | None:
    """The best fit from the most promising starts that differ."""
    few = pixels.thinned(_SECTIONS_TO_START)
    chosen: list[Floats] = []
    for i in np.argsort([unexplained(few, start) for start in starts]):
        if all(np.abs(starts[i] - other).max() > _DIFFERENT for other in chosen):
            chosen.append(starts[i])
        if len(chosen) == TRIED:
            break
    fitted = [borders for start in chosen if (borders := fit_borders(pixels, start, noise)) is not None]
    fitted = [borders for borders in fitted if abs(borders.ends.mean()) <= NEAR_PX + 1]
    return min(fitted, key=lambda borders: unexplained(pixels, borders.ends), default=None)


def _on_axis(pixels: Strip, t: Floats, ends: Floats, covariance: Floats, width: Floats, edges: int) -> RefinedLine:
    """Points of an axis with u `ends` (2,) at both ends of a strip."""
    by_ends = np.column_stack((1 - t, t))
    variance = np.einsum("ki,ij,kj->k", by_ends, covariance, by_ends)
    return RefinedLine(pixels.point(t, by_ends @ ends), np.sqrt(variance * max(1.0, len(t) / 2)), width, edges)
