"""Finds printed targets in a picture and measures their corners."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis.targets.circles import measurable, measure_circles
from analysis.targets.corners import LARGEST, SMALLEST, measure_corners
from analysis.targets.pattern import CORNERS, DICTIONARY, FIRST_CIRCLES, MARKER, Layout
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.images.picture import Grey

#: A window reaches to the marker's corner, 0.29 sides away, at most; a part of that stays free for the blur.
_WINDOW: Final = 0.24
#: Sides between two predictions of one corner of the board, beyond which the board is another one.
_APART: Final = 0.35
#: A corner is none if the edges explain so little of the contrast, or its place is that uncertain.
_MISFIT: Final = 0.2
_UNSURE: Final = 0.25  # px
#: Nor if its window fits so many times worse than half of them: something else is in it, such as another target's edge.
_STRANGE: Final = 2.5


@dataclass(frozen=True, slots=True)
class Corner:
    """A measured corner, or centre of a disc: place (px, pixel frame) and sigmas (px), and how far it was fitted.

    Attributes:
        reach: two columns, px, pixel frame, given row by row: along both edges, or spanning the disc's ellipse.
    """

    x: float
    y: float
    sigma_x: float
    sigma_y: float
    reach: tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What a picture shows of the targets.

    Attributes:
        size: width, height (px).
        corners: by name.
        targets: by code, (4, 2) px where its corners are about, clockwise from the top left.
        doubled: codes that are in it more than once; no corner of them is measured.
        mirrored: whether it shows targets only in a mirror.
        blur: median width of its edges (px); NaN without corners.
    """

    size: tuple[int, int]
    corners: Mapping[str, Corner]
    targets: Mapping[int, Floats]
    doubled: tuple[int, ...]
    mirrored: bool
    blur: float


def find_targets(image: Grey, layout: Layout, name: str) -> Sight:
    """Find the targets of a picture.

    Args:
        image: (rows, columns) grey values.
        layout: what was printed.
        name: of the picture, for messages.

    Raises:
        BadInputError: the board in it is not the one of `layout`.
    """
    size = image.shape[1], image.shape[0]
    eight = np.ascontiguousarray(np.clip(np.rint(image), 0, 255), np.uint8)
    found = _markers(eight, layout)
    times = Counter(code for code, _ in found)
    doubled = tuple(sorted(code for code, count in times.items() if count > 1))
    targets = {code: _square(quad) for code, quad in found if times[code] == 1}
    if not found:
        return Sight(size, {}, {}, (), bool(_markers(np.ascontiguousarray(eight[:, ::-1]), layout)), np.nan)
    squares = {code: square for code, square in targets.items() if code < FIRST_CIRCLES}
    circles = {code: square for code, square in targets.items() if code >= FIRST_CIRCLES and measurable(square, size)}
    grey = np.asarray(image, np.float32)
    corners, blur = _measured(grey, _wanted(squares, layout, name), circles, layout)
    return Sight(size, corners, targets, doubled, mirrored=False, blur=blur)


def _markers(image: NDArray[np.uint8], layout: Layout) -> list[tuple[int, Floats]]:
    """Codes and (4, 2) corners of the markers in a picture."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    # windows of the adaptive threshold up to a tenth of the picture, for markers near and far
    parameters.adaptiveThreshWinSizeMin, parameters.adaptiveThreshWinSizeStep = 5, 12
    parameters.adaptiveThreshWinSizeMax = max(29, min(image.shape) // 10)
    parameters.minMarkerPerimeterRate = 0.02
    parameters.perspectiveRemovePixelPerCell = 8  # fields three pixels wide, seen aslant, are misread with OpenCV's 4
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(DICTIONARY), parameters)
    quads, codes, _ = detector.detectMarkers(image)
    if codes is None:
        return []
    known = frozenset(layout.codes)
    named = zip(codes.ravel().tolist(), quads, strict=True)
    return [(int(code), np.array(quad, dtype=float).reshape(4, 2)) for code, quad in named if code in known]


def _square(quad: Floats) -> Floats:
    """(4, 2) the corners of the white square around a marker with these corners, by its homography."""
    h = cv2.getPerspectiveTransform((CORNERS * MARKER).astype(np.float32), quad.astype(np.float32))
    far = np.column_stack((CORNERS, np.ones(4))) @ h.T
    return np.asarray(far[:, :2] / far[:, 2:], float)


@dataclass(frozen=True, slots=True, eq=False)
class _Wanted:
    """A corner to measure: about where, along which edges (2, 2) into a white field, and how long these are (px)."""

    place: Floats
    edges: Floats
    length: float


def _wanted(targets: Mapping[int, Floats], layout: Layout, name: str) -> dict[str, _Wanted]:
    """The corners of the targets by name; one that two targets of the board share is between their predictions.

    Raises:
        BadInputError: they do not fit together.
    """
    wanted: dict[str, _Wanted] = {}
    for code, square in targets.items():
        for i, corner in enumerate(layout.corners(code)):
            if corner is None:
                continue
            along = square[[(i + 1) % 4, (i - 1) % 4]] - square[i]
            lengths = np.linalg.norm(along, axis=1)
            place, length = square[i], float(lengths.min())
            if (other := wanted.get(corner)) is not None:
                if np.linalg.norm(other.place - place) > _APART * length:
                    raise BadInputError(
                        f"{name}: the board in it does not have {layout.columns} x {layout.rows} squares; say how many "
                        "it has, as with svev target: --board COLUMNSxROWS"
                    )
                place, length = (other.place + place) / 2.0, min(length, other.length)
            wanted[corner] = _Wanted(place, along / lengths[:, None], length)
    return wanted


def _measured(
    grey: NDArray[np.float32], wanted: Mapping[str, _Wanted], circles: Mapping[int, Floats], layout: Layout
) -> tuple[dict[str, Corner], float]:
    """Corners and centres of circles that are measured well, and the median width of their edges."""
    radii = {name: int(min(_WINDOW * each.length, LARGEST)) for name, each in wanted.items()}
    names: list[str] = []
    fits = []
    for radius in sorted({radius for radius in radii.values() if radius >= SMALLEST}):
        some = [name for name in wanted if radii[name] == radius]
        place = np.array([wanted[name].place for name in some])
        edges = np.array([wanted[name].edges for name in some])
        fits.append(measure_corners(grey, place, edges, radius))
        names += some
    if circles:
        fits.append(measure_circles(grey, np.array(list(circles.values()))))
        names += [str(corner) for code in circles for corner in layout.corners(code)]
    if not names:
        return {}, np.nan
    xy, cofactor, noise, contrast, blur, reach, good = (
        np.concatenate([getattr(fit, part) for fit in fits])
        for part in ("xy", "cofactor", "noise", "contrast", "blur", "reach", "good")
    )
    good &= (contrast > 0.0) & (noise < _MISFIT * np.abs(contrast))
    if not good.any():
        return {}, np.nan
    # the noise of one window is known poorly; that of all windows of a picture well
    usual = float(np.median(noise[good]))
    sigma = np.sqrt(cofactor) * usual
    good &= (sigma.max(axis=1) < _UNSURE) & (noise < _STRANGE * usual)
    discs = good[len(good) - len(CORNERS) * len(circles) :].reshape(-1, len(CORNERS))
    discs &= discs.all(axis=1, keepdims=True)  # all of a target gave the offset of each
    corners = {}
    for i in np.flatnonzero(good).tolist():
        (x, y), (sigma_x, sigma_y), ((a, b), (c, d)) = xy[i].tolist(), sigma[i].tolist(), reach[i].tolist()
        corners[names[i]] = Corner(x, y, sigma_x, sigma_y, ((a, b), (c, d)))
    return corners, float(np.median(blur[good])) if good.any() else np.nan
