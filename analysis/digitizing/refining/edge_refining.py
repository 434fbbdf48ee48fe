"""Refines clicks on an edge to their feet on it, and lines that were drawn along an edge or a bar."""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from analysis.digitizing.refining.edge_profiles import REACH_PX, Borders, Strip, fit_borders, strip
from analysis.digitizing.refining.fit_judgement import (
    MODEL,
    NEAR_PX,
    NOISE,
    inside,
    is_poor,
    is_significant,
    noise_around,
    part_around,
    poor,
)
from rig.arrays import Floats
from rig.errors import NoFitError
from rig.images.picture import Grey
from rig.phrase import Phrase, phrase

_EDGE_HALF = 5.0  # px along an edge that are fitted, to either side
_WIDTHS = (1.5, 2.5, 4.0)  # px to the other edge of a bar, to start from
_REACH = NEAR_PX + max(_WIDTHS) + REACH_PX  # px beside a line that are looked at
_WORST_PX = 1.0  # sigma of a border
_NONE_NEAR: Final = phrase("hand_edge_none_near", "nothing straight within 4 px of the click")


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
    """A line in an image.

    Attributes:
        xy: (2, 2) px, two points of it whose errors are independent.
        sigma: standard deviation of each across the line, px.
    """

    xy: Floats
    sigma: float


def refine_edge(image: Grey, xy: Floats, direction: Floats | None = None) -> RefinedEdge:
    """The edge at a click.

    Args:
        image: (rows, columns) grey values.
        xy: (2,) the click, px: at most `NEAR_PX` beside the edge.
        direction: (2,) along the edge, of any length; that of the strongest edge near the click if left out.

    Raises:
        NoFitError: there is no straight edge; the message says why.
    """
    xy = inside(image, xy)
    noise = noise_around(image, xy)
    along = _direction(image, xy) if direction is None else np.asarray(direction, float)
    along = along / np.hypot(*along)
    pixels = strip(image, xy - _EDGE_HALF * along, xy + _EDGE_HALF * along, _REACH)
    return _foot(pixels, *min(_sound(pixels, noise), key=lambda each: _off(*each)), xy)


def refine_line(image: Grey, start: Floats, end: Floats) -> RefinedLine:
    """The edge along a line that was drawn, or the axis of a thin bar.

    All of the line is fitted at once: feet of several clicks may lie on different edges of a bar.

    Args:
        image: (rows, columns) grey values.
        start: (2,) where the line begins, px: at most `NEAR_PX` beside the edge.
        end: (2,) where it ends, likewise.

    Raises:
        NoFitError: there is no straight edge; the message says why.
    """
    start, end = inside(image, start), inside(image, end)
    pixels = strip(image, start, end, _REACH)
    sound = _sound(pixels, noise_around(image, (start + end) / 2), bar_first=True)
    borders, k = min(sound, key=lambda each: _off(*each))
    # Of a bar both, of an edge that one.
    chosen = np.eye(2 * len(borders.ends))[2 * k : 2 * k + 2]
    if len(borders.ends) == 2:
        chosen = np.tile(np.eye(2), 2) / 2
    at_ends, covariance = chosen @ borders.ends.ravel(), chosen @ borders.covariance @ chosen.T
    turn = covariance[0, 0] + covariance[1, 1] - 2 * covariance[0, 1]
    middle = (covariance[0, 0] - covariance[0, 1]) / turn
    variance = float(covariance[0, 0] - middle**2 * turn)
    places = middle + np.array((-1, 1)) * np.sqrt(variance / turn)  # where the errors are independent
    u = at_ends[0] + places * (at_ends[1] - at_ends[0])
    return RefinedLine(pixels.point(places, u), float(np.sqrt(2 * variance)))


def _sound(pixels: Strip, noise: float, *, bar_first: bool = False) -> list[tuple[Borders, int]]:
    """Borders near a line that hold, and which of theirs; a bar rather than one of its edges, or that if it is alone.

    Raises:
        NoFitError: none does; the message says why.
    """
    reason = _NONE_NEAR
    for u in sorted(_steps(pixels), key=abs):
        pairs = [np.sort((u, u + aside))[:, None] * (1.0, 1.0) for width in _WIDTHS for aside in (-width, width)]
        edge = [np.full((1, 2), u)]  # a thin bar has another one beside it
        for starts in (pairs, edge) if bar_first else (edge, pairs):
            fitted = [borders for start in starts if (borders := fit_borders(pixels, start, noise)) is not None]
            found = [
                (borders, k) for borders in fitted for k in range(len(borders.ends)) if _off(borders, k) <= NEAR_PX
            ]
            reasons = [_why_poor(borders, noise) for borders, _ in found]
            sound = [each for each, why in zip(found, reasons, strict=True) if why is None]
            if sound:
                return sound
            reason = next((why for why in reasons if why is not None), reason)
    text = "no edge here: {why}; click nearer to it, or measure by hand"
    raise NoFitError(phrase("hand_no_edge", text, why=reason))


def _why_poor(borders: Borders, noise: float) -> Phrase | None:
    """What speaks against fitted borders, None: nothing."""
    if not is_significant(borders.explained, borders.unknowns):
        return NOISE
    if not all(is_significant(float(evidence), borders.sections) for evidence in borders.evidence):
        return phrase("hand_edge_unseen", "an edge is not seen")
    model = MODEL * float(borders.step.max())
    if is_poor(borders.square * noise**2 / (noise**2 + model**2), borders.redundancy):
        ratio = np.sqrt(borders.square * noise**2 / borders.redundancy / (noise**2 + model**2))
        return poor(float(ratio))
    worst = float(np.sqrt(np.diagonal(borders.covariance).max()))
    if worst > _WORST_PX:
        return phrase("hand_edge_unsure", "an edge is not determined, its sigma is {sigma:.1f} px", sigma=worst)
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
