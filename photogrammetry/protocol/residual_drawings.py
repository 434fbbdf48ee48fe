"""Drawings of what is left over: residuals in each image, their distribution, their run outwards, redundancy."""

from itertools import pairwise

import numpy as np
from scipy.stats import norm

from photogrammetry.adjustment.adjustment import Adjustment
from photogrammetry.adjustment.state import Floats
from photogrammetry.network import ImageFrame
from photogrammetry.protocol.canvas import Canvas
from photogrammetry.protocol.chart import Chart
from photogrammetry.protocol.document import Drawing
from photogrammetry.protocol.scales import nice, rounded_up
from photogrammetry.protocol.svg import Colour

_IMAGES = 24  # with more of them one drawing for each camera says more than one for each image
_VECTOR = 12.0  # drawn units of a typical residual
_LARGE = 3.29  # |w| that one sound observation in 1000 exceeds
_BINS = np.linspace(-5.0, 5.0, 21)
_STARS = 40  # of the longest row of the text
_BANDS = 10
_NAMES = 12  # images that fit as names under a chart


def residual_drawings(a: Adjustment) -> tuple[Drawing, ...]:
    """All drawings of residuals; none without image points."""
    if not len(a.problem.image):
        return ()
    drawings = [histogram(a), redundancy_drawing(a)]
    drawings += [radial for camera in range(len(a.network.cameras)) for radial in _radial(a, camera)]
    return (*drawings, *_vectors(a))


def histogram(a: Adjustment) -> Drawing:
    """Test values w of all observations, and the normal distribution that sound ones have."""
    w = np.concatenate([a.image_w().ravel(), a.relation_w()])
    w = w[np.isfinite(w)]
    heights, expected = _counts(w, _BINS)
    chart = Chart((-5.0, 5.0), (0.0, rounded_up(1.05 * max(heights.max(), expected.max(), 1.0))), "w", "observations")
    chart.bars(_BINS, heights, Colour.BLUE)
    x = np.linspace(-5.0, 5.0, 101)
    chart.curve(x, len(w) * (_BINS[1] - _BINS[0]) * norm.pdf(x), Colour.RED)
    chart.legend(Colour.BLUE, f"{len(w)} observations")
    chart.legend(Colour.RED, "standard normal")
    outside, there = int(np.sum(np.abs(w) > _LARGE)), 2.0 * norm.sf(_LARGE) * len(w)
    caption = (
        f"Normalized residuals w: {outside} of {len(w)} beyond {_LARGE}, {there:.1f} expected. "
        "What is beyond 5 stands in the last bar."
    )
    return Drawing(caption, chart.svg.rendered(caption), (*_text_histogram(w), caption))


def _counts(w: Floats, edges: Floats) -> tuple[Floats, Floats]:
    """How many fall between the edges, and how many are expected there; the ends take what is beyond."""
    inner = edges[1:-1]
    counts = np.bincount(np.searchsorted(inner, w, side="right"), minlength=len(edges) - 1)
    shares = np.diff(np.concatenate([[0.0], norm.cdf(inner), [1.0]]))
    return counts.astype(float), len(w) * shares


def _text_histogram(w: Floats) -> tuple[str, ...]:
    edges = _BINS[::2]
    counts, expected = _counts(w, edges)
    longest = max(counts.max(), expected.max(), 1.0)
    lines = ["Normalized residuals w, number (expected); the end rows take what is beyond:"]
    for low, high, count, there in zip(edges[:-1], edges[1:], counts, expected, strict=True):
        stars = "#" * round(_STARS * count / longest)
        lines.append(f"  {low:+3.0f} .. {high:+3.0f}  {count:6.0f} ({there:7.1f})  {stars}".rstrip())
    return tuple(lines)


def redundancy_drawing(a: Adjustment) -> Drawing:
    """Redundancy numbers of the image coordinates, image by image."""
    numbers, start = a.controlled.image_numbers, a.problem.start
    names = [image.name for image in a.network.images]
    wide = sum(len(name) for name in names) * 5.6 > 305.0 or len(names) > _NAMES
    label = "image, in the order of the table" if wide else "image"
    chart = Chart((0.5, len(names) + 0.5), (0.0, 1.0), label, "redundancy number r", () if wide else names)
    chart.rule(float(numbers.mean()), Colour.AMBER)
    for i, (begin, end) in enumerate(pairwise(start), 1):
        if begin < end:
            r = numbers[begin:end]
            chart.spread(i, float(r.min()), float(r.max()), Colour.BLUE)
            chart.dots(np.array([i]), np.array([r.mean()]), Colour.INK, 2.5)
    chart.legend(Colour.INK, "mean")
    chart.legend(Colour.BLUE, "least to largest")
    chart.legend(Colour.AMBER, f"all: {numbers.mean():.2f}")
    caption = (
        f"Redundancy numbers of the image coordinates, from {numbers.min():.2f} to {numbers.max():.2f}. "
        "Near 0 nothing checks an observation; near 1 its whole error shows."
    )
    return Drawing(caption, chart.svg.rendered(caption))


def _radial(a: Adjustment, camera: int) -> list[Drawing]:
    """The radial part of a calibrated camera's residuals against the radius: distortion that is left over."""
    entry, rows = a.network.cameras[camera], a.problem.camera == camera
    if not entry.estimate or np.sum(rows) < 2 * _BANDS:
        return []
    reduced = a.problem.xy[rows] - a.state.interior[camera, 1:3]
    radius = np.linalg.norm(reduced, axis=1)
    outwards = np.sum(a.image_residuals()[rows] * reduced, axis=1) / np.maximum(radius, 1e-12 * radius.max())
    largest = rounded_up(1.05 * float(np.abs(outwards).max()) or 1.0)
    chart = Chart((0.0, rounded_up(float(radius.max()))), (-largest, largest), f"radius ({_unit(a)})", _unit(a))
    chart.rule(0.0, Colour.SOFT)
    chart.dots(radius, outwards, Colour.BLUE, 1.1)
    bands = np.array_split(np.argsort(radius), _BANDS)
    at = np.array([radius[band].mean() for band in bands])
    mean = np.array([outwards[band].mean() for band in bands])
    error = np.array([outwards[band].std() / np.sqrt(len(band)) for band in bands])
    for x, y, e in zip(at, mean, error, strict=True):
        chart.spread(x, y - e, y + e, Colour.RED)
    chart.curve(at, mean, Colour.RED)
    chart.legend(Colour.BLUE, "radial residual")
    chart.legend(Colour.RED, "mean of each tenth, ± its sigma")
    caption = (
        f"Camera {entry.name}: residuals (adjusted - observed) outwards from the principal point, against the radius. "
        f"A mean that leaves zero is distortion left over; the largest is {np.abs(mean).max():.2g} {_unit(a)}."
    )
    return [Drawing(caption, chart.svg.rendered(caption))]


def _vectors(a: Adjustment) -> list[Drawing]:
    """Residuals as vectors over each image, or over each camera's images together where those are many."""
    by_image = len(a.network.images) <= _IMAGES
    names = (
        [f"Image {i.name}" for i in a.network.images] if by_image else [f"Camera {c.name}" for c in a.network.cameras]
    )
    belongs = a.problem.image if by_image else a.problem.camera
    cameras = [i.camera for i in a.network.images] if by_image else list(range(len(a.network.cameras)))
    drawings, residuals = [], a.image_residuals()
    large = np.nan_to_num(np.abs(a.image_w())).max(axis=1) > _LARGE
    typical = float(np.median(np.linalg.norm(residuals, axis=1)))
    for i, (name, camera) in enumerate(zip(names, cameras, strict=True)):
        rows = belongs == i
        if not rows.any():
            continue
        canvas = Canvas(_frame(a.network.cameras[camera].size, a.problem.xy[rows]), margin=16.0)
        magnified = nice(1.4 * _VECTOR * canvas.unit / typical) if typical > 0.0 else 1.0
        _outline(canvas, a.network.cameras[camera].size)
        for place, vector, wrong in zip(a.problem.xy[rows], residuals[rows], large[rows], strict=True):
            colour = Colour.RED if wrong else Colour.BLUE
            canvas.line(place, place + magnified * vector, colour, width=1.2)
            canvas.svg.dot(*canvas.at(place), Colour.INK, 1.1)
        root = float(np.sqrt(np.mean(residuals[rows] ** 2)))
        canvas.scale_bar(_unit(a), magnified)
        beyond = f", {int(large[rows].sum())} beyond |w| = {_LARGE} (red)" if large[rows].any() else ""
        caption = f"{name}: {int(rows.sum())} residuals{beyond}, the bar is their scale; rms {root:.3g} {_unit(a)}."
        drawings.append(Drawing(caption, canvas.svg.rendered(caption)))
    return drawings


def _unit(a: Adjustment) -> str:
    return "px" if a.network.image_frame is ImageFrame.PIXEL else "image units"


def _frame(size: tuple[int, int] | None, places: Floats) -> Floats:
    """What the drawing must show: the whole image where its size is known."""
    if size is None:
        return places
    half = np.array(size, dtype=float) / 2.0
    return np.vstack([places, -half, half])


def _outline(canvas: Canvas, size: tuple[int, int] | None) -> None:
    if size is not None:
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) * np.array(size) / 2.0
        canvas.svg.path([canvas.at(corner) for corner in corners], Colour.FAINT, width=1.0)
