"""Drawings of residuals: distribution, redundancy, radial part against the radius, vectors over the image."""

from itertools import pairwise

import numpy as np
from scipy.special import ndtr

from photogrammetry.adjustment.gross_errors.blunders import LARGE_W
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.reports.document import Drawing
from photogrammetry.reports.drawing.svg import Colour
from photogrammetry.reports.drawing.to_scale import Canvas, Chart, nice, rounded_up
from rig.arrays import Flags, Floats

_BINS = np.linspace(-5.0, 5.0, 21)
_STARS = 40  # length of the longest row in plain text
_BANDS = 10
_DOTS = 3000  # at most; more are a cloud, and slow to draw
_NAMES = 12  # images that fit as names under a chart
_IMAGES = 24  # with more of them only the means are drawn
_VECTOR = 17.0  # page units of a typical vector, at most
_LONGEST = 60.0  # page units of the longest vector, at most
_CELLS = 12  # along the longer side of the image
_RESIDUALS_LEAST = 3  # residuals in a cell, for a mean


def residual_drawings(a: Adjustment) -> tuple[Drawing, ...]:
    """All drawings of residuals; none without image points."""
    if not len(a.problem.image):
        return ()
    drawings = [histogram(a), redundancy_drawing(a)]
    drawings += [radial for camera in range(len(a.network.cameras)) for radial in _radial(a, camera)]
    return (*drawings, *patterns_of_cameras(a), *vectors_of_images(a))


def histogram(a: Adjustment) -> Drawing:
    """Histogram of the test values w of all observations, with the standard normal distribution."""
    w = np.concatenate([a.image_w().ravel(), a.relation_w()])
    w = w[np.isfinite(w)]
    heights, expected = _counts(w, _BINS)
    chart = Chart((-5.0, 5.0), (0.0, rounded_up(1.05 * max(heights.max(), expected.max(), 1.0))), "w", "observations")
    chart.bars(_BINS, heights, Colour.BLUE)
    x = np.linspace(-5.0, 5.0, 101)
    chart.curve(x, len(w) * (_BINS[1] - _BINS[0]) * np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi), Colour.RED)
    chart.legend(Colour.BLUE, f"{len(w)} observations")
    chart.legend(Colour.RED, "standard normal")
    outside, there = int(np.sum(np.abs(w) > LARGE_W)), 2.0 * float(ndtr(-LARGE_W)) * len(w)
    caption = (
        f"Normalized residuals w: {outside} of {len(w)} beyond {LARGE_W}, {there:.1f} expected. "
        "What is beyond 5 stands in the last bar."
    )
    return Drawing(caption, chart.svg.rendered(caption), (*_text_histogram(w), caption))


def _counts(w: Floats, edges: Floats) -> tuple[Floats, Floats]:
    """Actual and expected numbers between the edges; the outer bins include all values beyond."""
    inner = edges[1:-1]
    counts = np.bincount(np.searchsorted(inner, w, side="right"), minlength=len(edges) - 1)
    shares = np.diff(np.concatenate([[0.0], ndtr(inner), [1.0]]))
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
    """The radial part of a calibrated camera's residuals against the radius: shows remaining distortion."""
    entry, rows, unit = a.network.cameras[camera], a.problem.camera == camera, a.network.image_unit
    if not entry.estimate or np.sum(rows) < 2 * _BANDS:
        return []
    reduced = a.problem.xy[rows] - a.state.interior[camera, 1:3]
    radius = np.linalg.norm(reduced, axis=1)
    outwards = np.sum(a.image_residuals()[rows] * reduced, axis=1) / np.maximum(radius, 1e-12 * radius.max())
    largest = rounded_up(1.05 * float(np.abs(outwards).max()) or 1.0)
    chart = Chart(
        (0.0, rounded_up(float(radius.max()))),
        (-largest, largest),
        f"radius ({unit})",
        unit,
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
        f"A mean that leaves zero is distortion left over; the largest is {np.abs(mean).max():.2g} {unit}."
    )
    return [Drawing(caption, chart.svg.rendered(caption))]


def vectors_of_images(a: Adjustment) -> list[Drawing]:
    """The residuals of each image as vectors."""
    if len(a.network.images) > _IMAGES:
        return []
    drawings, residuals = [], a.image_residuals()
    large = np.nan_to_num(np.abs(a.image_w())).max(axis=1) > LARGE_W
    typical = float(np.median(np.linalg.norm(residuals, axis=1)))
    for i, image in enumerate(a.network.images):
        rows = a.problem.image == i
        if not rows.any():
            continue
        size = a.network.cameras[image.camera].size
        canvas = _drawn(size, a.problem.xy[rows], residuals[rows], large[rows], typical, a.network.image_unit)
        root = float(np.sqrt(np.mean(residuals[rows] ** 2)))
        beyond = f", {int(large[rows].sum())} beyond |w| = {LARGE_W} (red)" if large[rows].any() else ""
        caption = (
            f"Image {image.name}: {int(rows.sum())} residuals{beyond}, the bar is their scale; rms {root:.3g} "
            f"{a.network.image_unit}."
        )
        drawings.append(Drawing(caption, canvas.svg.rendered(caption)))
    return drawings


def patterns_of_cameras(a: Adjustment) -> list[Drawing]:
    """Mean residuals in the cells of a grid, for each camera with several images: shows errors of the lens model."""
    drawings, residuals = [], a.image_residuals()
    for i, camera in enumerate(a.network.cameras):
        rows = a.problem.camera == i
        if len(np.unique(a.problem.image[rows])) < 2:
            continue
        places, means = cell_means(a.problem.xy[rows], residuals[rows])
        if not len(places):
            continue
        sound = np.zeros(len(places), dtype=bool)
        typical = float(np.median(np.linalg.norm(means, axis=1)))
        canvas = _drawn(camera.size, places, means, sound, typical, a.network.image_unit)
        caption = (
            f"Camera {camera.name}: mean residual in each of {len(places)} cells, the bar is their scale. "
            "Neighbours that point the same way are what the lens model leaves out."
        )
        drawings.append(Drawing(caption, canvas.svg.rendered(caption)))
    return drawings


def cell_means(places: Floats, vectors: Floats, least: int = _RESIDUALS_LEAST) -> tuple[Floats, Floats]:
    """Means of places and vectors (n, 2) in the cells of a square grid that hold `least` of them: both (cells, 2)."""
    low = places.min(axis=0)
    side = float(np.ptp(places, axis=0).max()) / _CELLS or 1.0
    cell = np.minimum(((places - low) / side).astype(np.intp), _CELLS - 1)
    _, number, count = np.unique(cell[:, 0] * _CELLS + cell[:, 1], return_inverse=True, return_counts=True)
    sums = [np.bincount(number, part) for part in (*places.T, *vectors.T)]
    means = np.column_stack(sums) / count[:, None]
    enough = count >= least
    return means[enough, :2], means[enough, 2:]


def _drawn(
    size: tuple[int, int] | None,
    places: Floats,
    vectors: Floats,
    wrong: Flags,
    typical: float,
    unit: str,
) -> Canvas:
    """Vectors (n, 2) at places (n, 2) within the outline of the image, where its size is known."""
    half = np.zeros(2) if size is None else np.array(size) / 2.0
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) * half
    canvas = Canvas(places if size is None else np.vstack([places, corners]), margin=16.0)
    if size is not None:
        canvas.svg.path([canvas.at(corner) for corner in corners], Colour.FAINT, width=1.0)
    longest = float(np.linalg.norm(vectors, axis=1).max())
    magnified = nice(canvas.unit * min(_VECTOR / typical, _LONGEST / longest)) if min(typical, longest) > 0.0 else 1.0
    for place, vector, red in zip(places, vectors, wrong, strict=True):
        canvas.line(place, place + magnified * vector, Colour.RED if red else Colour.BLUE, width=1.2)
        canvas.svg.dot(*canvas.at(place), Colour.INK, 1.1)
    canvas.scale_bar(unit, magnified)
    return canvas
