"""Residuals as vectors over the image: each of them image by image, and their means over all images of a camera."""

import numpy as np

from photogrammetry.adjustment.adjustment import Adjustment
from photogrammetry.adjustment.state import Floats
from photogrammetry.network import ImageFrame
from photogrammetry.protocol.canvas import Canvas
from photogrammetry.protocol.document import Drawing
from photogrammetry.protocol.scales import nice
from photogrammetry.protocol.svg import Colour

LARGE = 3.29  # |w| that one sound observation in 1000 exceeds
_IMAGES = 24  # with more of them only the means are drawn
_VECTOR = 17.0  # drawn units of a typical one, at most
_LONGEST = 60.0  # of the longest
_CELLS = 12  # along the longer side of the image
_LEAST = 3  # residuals in a cell that has a mean


def image_unit(a: Adjustment) -> str:
    """The unit of image coordinates, for captions."""
    return "px" if a.network.image_frame is ImageFrame.PIXEL else "image units"


def vectors_of_images(a: Adjustment) -> list[Drawing]:
    """One drawing for each image."""
    if len(a.network.images) > _IMAGES:
        return []
    drawings, residuals = [], a.image_residuals()
    large = np.nan_to_num(np.abs(a.image_w())).max(axis=1) > LARGE
    typical = float(np.median(np.linalg.norm(residuals, axis=1)))
    for i, image in enumerate(a.network.images):
        rows = a.problem.image == i
        if not rows.any():
            continue
        size = a.network.cameras[image.camera].size
        canvas = _drawn(size, a.problem.xy[rows], residuals[rows], large[rows], typical, image_unit(a))
        root = float(np.sqrt(np.mean(residuals[rows] ** 2)))
        beyond = f", {int(large[rows].sum())} beyond |w| = {LARGE} (red)" if large[rows].any() else ""
        caption = (
            f"Image {image.name}: {int(rows.sum())} residuals{beyond}, the bar is their scale; rms {root:.3g} "
            f"{image_unit(a)}."
        )
        drawings.append(Drawing(caption, canvas.svg.rendered(caption)))
    return drawings


def patterns_of_cameras(a: Adjustment) -> list[Drawing]:
    """Mean residuals in the cells of a grid, for each camera with several images: what the lens model leaves out."""
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
        canvas = _drawn(camera.size, places, means, sound, typical, image_unit(a))
        caption = (
            f"Camera {camera.name}: mean residual in each of {len(places)} cells, the bar is their scale. "
            "Neighbours that point the same way are what the lens model leaves out."
        )
        drawings.append(Drawing(caption, canvas.svg.rendered(caption)))
    return drawings


def cell_means(places: Floats, vectors: Floats, least: int = _LEAST) -> tuple[Floats, Floats]:
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
    wrong: np.ndarray[tuple[int, ...], np.dtype[np.bool_]],
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
