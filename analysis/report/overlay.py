"""What is drawn over an image: measured points, the projected stick model, and how sure its points are."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.measurements.model import BINDING_OF, ImageMeasurements
from analysis.report.course import origin_of
from analysis.result.fates import ImageFate, PartFate
from analysis.result.model import JumperState, Status
from analysis.scene.camera_system import PlacedCamera
from rig.arrays import Floats

#: Red, green, blue.
Colour = tuple[int, int, int]
#: Of the parts of the stick figure, in pictures, pages and videos.
COLOURS: Final[Mapping[str, Colour]] = {
    "body": (255, 243, 92),
    "feet": (255, 243, 92),
    "right": (255, 157, 46),
    "left": (89, 194, 255),
}
#: Length of a ski, m (section 3 of the paper); the binding is at its middle.
SKI_LENGTH_M = 2.63
#: Drawn sizes of standard deviations: the true ones are smaller than a pixel.
ELLIPSE_SIGMAS = 10.0
#: Bits of sub-pixels when OpenCV draws.
SHIFT = 4
_DIAGONAL = float(np.sqrt(0.5))
_REFUSED: Final = (ImageFate.GROSS_ERROR, ImageFate.NOT_USED, ImageFate.RAW_ONLY)
_ALONG = np.linspace(0.0, 1.0, 9)[:, None]  # a straight line may be bent by the lens


@dataclass(frozen=True, slots=True, eq=False)
class Overlay:
    """What is drawn over one image, px.

    Attributes:
        lines: (m, 2) by part: body, feet, right, left.
        ellipses: by point its projected place (2,) and its covariance (2, 2).
        points: measured points (2,) by name.
        skis: measured points (k, 2) of the skis by side.
        predicted: points that were not measured at this pulse.
        refused: measured points that are not used.
    """

    lines: Mapping[str, Floats]
    ellipses: Mapping[str, tuple[Floats, Floats]]
    points: Mapping[str, Floats]
    skis: Mapping[str, Floats]
    predicted: frozenset[str]
    refused: frozenset[str] = frozenset()

    def places(self) -> Floats:
        """All places (n, 2), n >= 0."""
        measured = [xy[None] for xy in self.points.values()]
        found = [*self.lines.values(), *measured, *self.skis.values(), np.zeros((0, 2))]
        return np.concatenate(found)

    def mapped(self, origin: Floats, scale: float) -> "Overlay":
        """The overlay in another picture: `origin` (2,) comes to (0, 0), and a pixel becomes `scale` wide."""
        return Overlay(
            {part: (line - origin) * scale for part, line in self.lines.items()},
            {name: ((xy - origin) * scale, c * scale**2) for name, (xy, c) in self.ellipses.items()},
            {name: (xy - origin) * scale for name, xy in self.points.items()},
            {side: (xy - origin) * scale for side, xy in self.skis.items()},
            self.predicted,
            self.refused,
        )

    def crosses(self, half: float) -> Iterator[tuple[tuple[float, float], tuple[float, float]]]:
        """The two lines of each measured point, from where to where: upright crosses, turned ones where it is refused.

        Args:
            half: half the length of a line, px.
        """
        for name, (x, y) in self.points.items():
            dx, dy = (half * _DIAGONAL, half * _DIAGONAL) if name in self.refused else (half, 0.0)
            yield (x - dx, y - dy), (x + dx, y + dy)
            yield (x + dy, y - dx), (x - dy, y + dx)


def stick_lines(state: JumperState) -> dict[str, Floats]:
    """The lines (m, 3) of the stick model of Fig. 6, as far as its points are known.

    body: P1, P2, O; feet: P3, P4; right and left: the skis, tail to tip.
    """
    known = {name: point.xyz for name, point in state.points.items() if point is not None}
    origin = origin_of(state)
    lines = {}
    body = [known[name] for name in ("P1", "P2") if name in known] + ([] if origin is None else [origin])
    if "P2" in known and len(body) > 1:
        lines["body"] = np.stack(body)
    if origin is not None:
        lines["feet"] = np.stack((known["P3"], known["P4"]))
    for side, binding in BINDING_OF.items():
        ski = state.skis.get(side)
        if ski is not None and binding in known:
            half = SKI_LENGTH_M / 2 * ski.direction
            lines[side] = np.stack((known[binding] - half, known[binding] + half))
    return lines


def overlay_of(
    state: JumperState,
    measured: ImageMeasurements | None,
    camera: PlacedCamera,
    fates: Mapping[str, PartFate] | None = None,
) -> Overlay:
    """What is drawn over an image.

    Args:
        state: the jumper at this pulse.
        measured: what was measured in this image.
        camera: that took it.
        fates: what became of it.
    """
    images = {} if fates is None else {what: part.images.get(camera.name) for what, part in fates.items()}
    projected = {part: camera.project(_dense(line)) for part, line in stick_lines(state).items()}
    points = {} if measured is None else {name: point.xy for name, point in measured.points.items()}
    skis = {} if measured is None else {side: ski.xy for side, ski in measured.skis.items()}
    return Overlay(
        {part: line for part, line in projected.items() if np.isfinite(line).all()},
        _ellipses(state, camera),
        points,
        skis,
        frozenset(n for n, point in state.points.items() if point is not None and point.status is Status.PREDICTED),
        frozenset(what for what, fate in images.items() if fate in _REFUSED),
    )


def half_axes(covariance: Floats, sigmas: float = ELLIPSE_SIGMAS) -> tuple[float, float, float]:
    """Long and short half axis of the ellipse of a (2, 2) covariance, and the turn of the long one, degrees.

    The turn counts from x towards y.
    """
    values, vectors = np.linalg.eigh(covariance)
    short, long = sigmas * np.sqrt(np.maximum(values, 0.0))
    return float(long), float(short), float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))


def _dense(line: Floats) -> Floats:
    """More points on a line (m, 3)."""
    return np.concatenate([a + _ALONG * (b - a) for a, b in pairwise(line)])


def _ellipses(state: JumperState, camera: PlacedCamera) -> dict[str, tuple[Floats, Floats]]:
    known = {name: point for name, point in state.points.items() if point is not None and camera.in_front(point.xyz)}
    if not known:
        return {}
    xyz = np.stack([point.xyz for point in known.values()])
    xy = camera.project(xyz)
    _, by_point, _ = camera.linearised(xyz, xy)
    covariances = np.stack([point.covariance for point in known.values()])
    spread = by_point @ covariances @ by_point.transpose(0, 2, 1)
    return {name: (xy[i], spread[i]) for i, name in enumerate(known)}


def fine(places: Floats) -> NDArray[np.int32]:
    """Places in px as OpenCV takes them with `SHIFT` bits of sub-pixels."""
    return np.asarray(np.rint(np.clip(places, -1e5, 1e5) * (1 << SHIFT)), np.int32)
