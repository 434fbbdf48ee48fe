"""Drawings of what is left over: distribution, redundancy, run outwards, and the vectors."""

from itertools import pairwise

import numpy as np
from scipy.stats import norm

from photogrammetry.adjustment.adjustment import Adjustment
from photogrammetry.adjustment.state import Floats
from photogrammetry.protocol.chart import Chart
from photogrammetry.protocol.document import Drawing
from photogrammetry.protocol.residual_vectors import LARGE, image_unit, patterns_of_cameras, vectors_of_images
from photogrammetry.protocol.scales import rounded_up
from photogrammetry.protocol.svg import Colour

_BINS = np.linspace(-5.0, 5.0, 21)
_STARS = 40  # of the longest row of the text
_BANDS = 10
_DOTS = 3000  # more are a cloud, and slow to draw
_NAMES = 12  # images that fit as names under a chart


def residual_drawings(a: Adjustment) -> tuple[Drawing, ...]:
    """All drawings of residuals; none without image points."""
    if not len(a.problem.image):
        return ()
    drawings = [histogram(a), redundancy_drawing(a)]
    drawings += [radial for camera in range(len(a.network.cameras)) for radial in _radial(a, camera)]
    return (*drawings, *patterns_of_cameras(a), *vectors_of_images(a))


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
    outside, there = int(np.sum(np.abs(w) > LARGE)), 2.0 * norm.sf(LARGE) * len(w)
    caption = (
        f"Normalized residuals w: {outside} of {len(w)} beyond {LARGE}, {there:.1f} expected. "
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
    chart = Chart(
        (0.0, rounded_up(float(radius.max()))), (-largest, largest), f"radius ({image_unit(a)})", image_unit(a)
    )
    chart.rule(0.0, Colour.SOFT)
    every = -(-len(radius) // _DOTS)
    chart.dots(radius[::every], outwards[::every], Colour.BLUE, 1.1)
    bands = np.array_split(np.argsort(radius), _BANDS)
    at = np.array([radius[band].mean() for band in bands])
    mean = np.array([outwards[band].mean() for band in bands])
    error = np.array([outwards[band].std() / np.sqrt(len(band)) for band in bands])
    for x, y, e in zip(at, mean, error, strict=True):
        chart.spread(x, y - e, y + e, Colour.RED)
    chart.curve(at, mean, Colour.RED)
    chart.legend(Colour.BLUE, "radial residual" if every == 1 else f"radial residual, every {every}th")
    chart.legend(Colour.RED, "mean of each tenth, ± its sigma")
    caption = (
        f"Camera {entry.name}: residuals (adjusted - observed) outwards from the principal point, against the radius. "
        f"A mean that leaves zero is distortion left over; the largest is {np.abs(mean).max():.2g} {image_unit(a)}."
    )
    return [Drawing(caption, chart.svg.rendered(caption))]
