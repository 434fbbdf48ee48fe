"""Draws a network from above and from the side, with the one-sigma ellipses of points and cameras."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.network.model import AXES, Role
from photogrammetry.reports.document import Drawing
from photogrammetry.reports.drawing.svg import Colour
from photogrammetry.reports.drawing.to_scale import Canvas, nice
from rig.arrays import Floats, Integers

_NAMED = 60  # with more points names cover the drawing
_SIGHTED = 12  # with more images their fields of view cover the drawing
_ELLIPSE = 11.0  # page units, size of a typical ellipse
_LARGEST = 3.0  # times that: size of the largest ellipse, at most
_CLOSER = 0.7  # points that fill less of the network than this are drawn once more, closer
_SIDES = ((0, 1), (0, 2))
_SEEN_FROM = ("from above", "from the side")
_WHOLE = "Network (cameras green, surveyed points blue)"


class Shape(Enum):
    """Symbols of the drawing."""

    DOT = "dot"
    TRIANGLE = "triangle"


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """A point or camera to draw: (3,) coordinates, (3, 3) covariance (None: error-free or not shown)."""

    name: str
    xyz: Floats
    covariance: Floats | None
    colour: Colour
    shape: Shape = Shape.DOT


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A line through (n, 3) coordinates."""

    xyz: Floats
    colour: Colour
    width: float = 1.0


@dataclass(frozen=True, slots=True)
class Extras:
    """Further things to draw with the network, for instance a flight.

    Attributes:
        places: to draw.
        tracks: to draw.
        words: their description for the caption.
        instead_of: indices of the network's points that they replace.
    """

    places: tuple[Place, ...] = ()
    tracks: tuple[Track, ...] = ()
    words: str = ""
    instead_of: frozenset[int] = frozenset()


def network_drawings(a: Adjustment, extras: Extras | None = None, *, a_priori: bool = False) -> tuple[Drawing, ...]:
    """The network from above and from the side; once more without the cameras if these stand far away.

    Args:
        a: the network.
        extras: further things to draw.
        a_priori: the ellipses follow from the given sigmas alone (a plan has no residuals).
    """
    if not len(a.network.points) or not len(a.network.images):
        return ()
    extras = Extras() if extras is None else extras
    points, cameras = _points(a, a_priori=a_priori), _cameras(a, a_priori=a_priori)
    nearby = [place for i, place in enumerate(points) if i not in extras.instead_of]
    nearby += extras.places
    unit = a.length_unit
    far = _extent([*nearby, *cameras]) * _CLOSER > _extent(nearby)
    sights = _sights(a, np.array([place.xyz for place in nearby])) if len(cameras) <= _SIGHTED else []
    whole = [replaced for place in nearby for replaced in (_bare(place) if far else place,)]
    drawings = [
        _projected([*whole, *cameras], [*sights, *extras.tracks], side, unit, _WHOLE) for side in range(len(_SIDES))
    ]
    if far:
        words = f"Points{extras.words}"
        drawings += [_projected(nearby, extras.tracks, side, unit, words) for side in range(len(_SIDES))]
    return tuple(drawings)


def _points(a: Adjustment, *, a_priori: bool) -> list[Place]:
    covariances = _covariance(a, a.problem.unknowns.point, a_priori=a_priori)
    return [
        Place(point.name, xyz, covariance, Colour.INK if point.role is Role.TIE else Colour.BLUE)
        for point, xyz, covariance in zip(a.network.points, a.state.xyz, covariances, strict=True)
    ]


def _cameras(a: Adjustment, *, a_priori: bool) -> list[Place]:
    covariances = _covariance(a, a.problem.unknowns.pose[:, :3], a_priori=a_priori)
    return [
        Place(image.name, xyz, covariance, Colour.GREEN, Shape.TRIANGLE)
        for image, xyz, covariance in zip(a.network.images, a.state.position, covariances, strict=True)
    ]


def _covariance(a: Adjustment, columns: Integers, *, a_priori: bool) -> Floats:
    """(n, 3, 3) of unknowns (n, 3); zeros for constants."""
    if not a_priori:
        return a.covariance(columns)
    padded = np.pad(a.cofactors, ((0, 1), (0, 1)))  # column -1: constants
    return np.asarray(padded[columns[:, :, None], columns[:, None, :]])


def _sights(a: Adjustment, nearby: Floats) -> list[Track]:
    """The left and right edges of each image's field of view; its axis if the image size is unknown."""
    middle, tracks = nearby.mean(axis=0), []
    for i, image in enumerate(a.network.images):
        camera, rotation, position = a.network.cameras[image.camera], a.state.rotation[i], a.state.position[i]
        depth = float(rotation[:, 2] @ (position - middle))
        half = camera.size[0] / 2.0 / a.state.interior[image.camera, 0] if camera.size is not None else 0.0
        for side in (-half, half):
            end = position + 1.15 * depth * (rotation @ np.array([side, 0.0, -1.0]))
            tracks.append(Track(np.stack((position, end)), Colour.FAINT))
    return tracks


def _bare(place: Place) -> Place:
    """Without name and ellipse."""
    return Place("", place.xyz, None, place.colour, place.shape)


def _extent(places: Sequence[Place]) -> float:
    xyz = np.array([place.xyz for place in places])
    return float(np.linalg.norm(np.ptp(xyz, axis=0)))


def _projected(places: Sequence[Place], tracks: Iterable[Track], side: int, unit: str, words: str) -> Drawing:
    axes = list(_SIDES[side])
    canvas = Canvas(np.array([place.xyz[axes] for place in places]))
    for track in tracks:
        canvas.svg.path([canvas.at(xyz[axes]) for xyz in track.xyz], track.colour, width=track.width)
    errors = [(place, _part(place.covariance, axes)) for place in places if place.covariance is not None]
    magnified = _magnification([float(np.sqrt(np.trace(c))) for _, c in errors], _ELLIPSE * canvas.unit)
    for place, covariance in errors:
        canvas.ellipse(place.xyz[axes], covariance, magnified, Colour.RED)
    for place in places:
        if place.shape is Shape.TRIANGLE:
            canvas.svg.triangle(*canvas.at(place.xyz[axes]), place.colour)
        else:
            canvas.svg.dot(*canvas.at(place.xyz[axes]), place.colour, 1.8 if place.name else 1.1)
    if sum(bool(place.name) for place in places) <= _NAMED:
        for place in places:
            if place.name:
                canvas.svg.label(*canvas.at(place.xyz[axes]), place.name)
    canvas.scale_bar(unit)
    canvas.axes(*(AXES[axis] for axis in axes))
    caption = f"{words} {_SEEN_FROM[side]}: one-sigma ellipses (red) {magnified:g} times as large as they are."
    return Drawing(caption, canvas.svg.rendered(caption))


def _part(covariance: Floats, axes: list[int]) -> Floats:
    return np.asarray(covariance[np.ix_(axes, axes)])


def _magnification(sizes: list[float], drawn: float) -> float:
    """A round magnification that draws a typical size at length `drawn`, and the largest not too large."""
    known = [size for size in sizes if size > 0.0]
    return nice(drawn * min(1.4 / float(np.median(known)), _LARGEST / max(known))) if known else 1.0
