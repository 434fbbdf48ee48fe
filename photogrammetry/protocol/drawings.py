"""Drawings of a protocol: the network with its error ellipses, and the residuals of each camera."""

import numpy as np

from photogrammetry.adjustment.adjustment import Adjustment
from photogrammetry.adjustment.state import Floats
from photogrammetry.network import ImageFrame, Role
from photogrammetry.protocol.canvas import Canvas
from photogrammetry.protocol.document import Drawing

_NAMED = 60  # with more points names cover the drawing
_ELLIPSE = 12.0  # drawn pixels of a typical one
_VECTOR = 12.0  # of a typical residual
_SURVEYED, _NEW, _CAMERA, _ERROR = "#1f6fb4", "#222", "#2a7f3f", "#c0392b"
_AXES = "XYZ"


def network_drawings(a: Adjustment) -> tuple[Drawing, ...]:
    """The network from above and from the side, with the points' and cameras' one-sigma ellipses."""
    if not len(a.network.points) or not len(a.network.images):
        return ()
    return tuple(_projected(a, first, second) for first, second in ((0, 1), (0, 2)))


def _projected(a: Adjustment, first: int, second: int) -> Drawing:
    axes = [first, second]
    points, stations = a.state.xyz[:, axes], a.state.position[:, axes]
    canvas = Canvas(np.vstack([points, stations]))
    at_points = a.covariance(a.problem.unknowns.point[:, axes])
    at_stations = a.covariance(a.problem.unknowns.pose[:, axes])
    magnified = _magnification(np.sqrt(at_points.trace(axis1=1, axis2=2)), _ELLIPSE * canvas.unit)
    for point, place, covariance in zip(a.network.points, points, at_points, strict=True):
        canvas.ellipse(place, covariance, magnified, _ERROR)
        canvas.dot(place, _NEW if point.role is Role.TIE else _SURVEYED)
        if len(points) <= _NAMED:
            canvas.text(place, point.name)
    for image, place, covariance in zip(a.network.images, stations, at_stations, strict=True):
        canvas.ellipse(place, covariance, magnified, _ERROR)
        canvas.triangle(place, _CAMERA)
        if len(stations) <= _NAMED:
            canvas.text(place, image.name)
    caption = (
        f"Network in {_AXES[first]} (right) and {_AXES[second]} (up): surveyed points blue, others black, cameras "
        f"green; one-sigma ellipses {magnified:.3g} times magnified"
    )
    return Drawing(caption, canvas.svg())


def residual_drawings(a: Adjustment) -> tuple[Drawing, ...]:
    """The residuals of each camera, all its images in one: a pattern is what the lens model leaves out."""
    residuals, drawings = a.image_residuals(), []
    sizes = np.linalg.norm(residuals, axis=1)
    unit = "px" if a.network.image_frame is ImageFrame.PIXEL else "image units"
    for index, camera in enumerate(a.network.cameras):
        rows = a.problem.camera == index
        if not rows.any():
            continue
        places, v = a.problem.xy[rows], residuals[rows]
        canvas = Canvas(_frame(camera.size, places))
        magnified = _magnification(sizes[rows], _VECTOR * canvas.unit)
        for place, vector in zip(places, v, strict=True):
            canvas.line(place, place + magnified * vector, _ERROR)
            canvas.dot(place, _NEW, 1.2)
        root = float(np.sqrt(np.mean(v**2)))
        caption = f"Residuals of camera {camera.name}, {magnified:.3g} times magnified; rms {root:.3g} {unit}"
        drawings.append(Drawing(caption, canvas.svg()))
    return tuple(drawings)


def _frame(size: tuple[int, int] | None, places: Floats) -> Floats:
    """What the drawing must show: the whole image where its size is known."""
    if size is None:
        return places
    half = np.array(size, dtype=float) / 2.0
    return np.vstack([places, -half, half])


def _magnification(sizes: Floats, drawn: float) -> float:
    """So that a typical one is drawn at a given length of the world."""
    known = sizes[sizes > 0.0]
    return drawn / float(np.median(known)) if len(known) else 1.0
