"""Points, lines and the stick model out of image points, by names: the paper's step 3 for programs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.intersection.line_intersection import LineState, SpaceLines, intersect_lines_in_one_step
from photogrammetry.intersection.point_intersection import PointState
from photogrammetry.intersection.point_intersection import intersect_points as intersect
from photogrammetry.jumper.stick_model import ANGLES, body_angles
from photogrammetry.programming.views import View
from rig.arrays import Flags, Floats
from rig.errors import BadInputError


@dataclass(frozen=True, slots=True, eq=False)
class SpacePoint:
    """An intersected point.

    Attributes:
        xyz: (3,); NaN where nothing determines it.
        sigma: (3,) from the a-priori sigma; orientations count as known.
        covariance: (3, 3), likewise.
        residuals: (2,) by image, adjusted - observed, reduced and metric (y up).
        determined: whether the point can be used.
        words: why not, and what to do; or "determined".
    """

    xyz: Floats
    sigma: Floats
    covariance: Floats
    residuals: dict[str, Floats]
    determined: bool
    words: str


@dataclass(frozen=True, slots=True, eq=False)
class SpaceLine:
    """An intersected line, Z = alpha X + gamma, Y = beta X + delta.

    Attributes:
        parameters: (4,) alpha, beta, gamma, delta.
        covariance: (4, 4) of them, from the a-priori sigma.
        direction: (3,) unit vector towards larger X.
        determined: whether the line can be used.
        words: why not, and what to do; or "determined".
    """

    parameters: Floats
    covariance: Floats
    direction: Floats
    determined: bool
    words: str

    def at(self, x: float) -> Floats:
        """The point (3,) of the line at X = x."""
        alpha, beta, gamma, delta = self.parameters
        return np.array([x, beta * x + delta, alpha * x + gamma])


@dataclass(frozen=True, slots=True)
class StickAngles:
    """The angles of Fig. 6, degrees; `photogrammetry.jumper.stick_model` defines them."""

    alpha: float
    beta: float
    gamma: float
    dphi: float
    phi: float


def intersect_points(
    points: Mapping[str, Mapping[str, ArrayLike]], views: Mapping[str, View], *, sigma: float
) -> dict[str, SpacePoint]:
    """Intersect points from two or more images each (appendix C.1).

    Args:
        points: image points (2,) by point and image, in the network's frame.
        views: the oriented images.
        sigma: standard deviation of x and y, image unit.

    Raises:
        BadInputError: an image is not among the views, or a number is not finite.
    """
    xy, seen = np.zeros((len(points), len(views), 2)), np.zeros((len(points), len(views)), dtype=bool)
    for i, rays in enumerate(points.values()):
        for image, place in rays.items():
            j = _index(image, views)
            xy[i, j], seen[i, j] = views[image].reduced(_checked(place, (2,), image)), True
    found = intersect([view.ideal for view in views.values()], xy, seen=seen, sigma=sigma)
    return {
        name: SpacePoint(
            found.X[i],
            found.sigma[i],
            found.covariance[i],
            {image: found.residuals[i, _index(image, views)] for image in rays},
            bool(found.ok[i]),
            PointState(found.state[i]).words,
        )
        for i, (name, rays) in enumerate(points.items())
    }


def intersect_lines(
    lines: Mapping[str, Mapping[str, ArrayLike]], views: Mapping[str, View], *, sigma: float
) -> dict[str, SpaceLine]:
    """Intersect straight lines, such as skis, from points measured anywhere along them (appendix C.2).

    Args:
        lines: (k, 2) points of the line by line and image, in the network's frame; k may differ, two at least.
        views: the oriented images; each line is in two of them at least.
        sigma: standard deviation of x and y of each point, image unit.

    Raises:
        BadInputError: an image is not among the views, or points coincide or are not finite.
    """
    if not lines:
        return {}
    most = max((len(np.atleast_2d(places)) for images in lines.values() for places in images.values()), default=0)
    xy = np.zeros((len(lines), len(views), most, 2))
    seen: Flags = np.zeros(xy.shape[:-1], dtype=bool)
    for i, images in enumerate(lines.values()):
        for image, places in images.items():
            j, given = _index(image, views), _checked(places, (-1, 2), image)
            xy[i, j, : len(given)], seen[i, j, : len(given)] = views[image].reduced(given), True
    found = intersect_lines_in_one_step([view.ideal for view in views.values()], xy, sigma, seen=seen)
    return {name: _line(found, i) for i, name in enumerate(lines)}


def stick_angles(
    *,
    helmet: ArrayLike,
    hip: ArrayLike,
    bindings: Sequence[ArrayLike],
    right_ski: ArrayLike,
    left_ski: ArrayLike,
) -> StickAngles:
    """The stick model of Fig. 6 of one pose.

    Args:
        helmet: P1 (3,), Z up.
        hip: P2 (3,).
        bindings: P3 and P4 (3,); the origin O lies midway.
        right_ski: direction (3,) of the right ski, tail to tip, of any length.
        left_ski: of the left one.
    """
    origin = np.mean([np.asarray(binding, float) for binding in bindings], axis=0)
    given = (np.asarray(each, float) for each in (helmet, hip, origin, right_ski, left_ski))
    angles = body_angles(*given)
    return StickAngles(**{name: math.degrees(angle) for name, angle in zip(ANGLES, angles.tolist(), strict=True)})


def _line(found: SpaceLines, i: int) -> SpaceLine:
    return SpaceLine(
        found.parameters[i],
        found.covariance[i],
        found.direction[i],
        bool(found.ok[i]),
        LineState(found.state[i]).words,
    )


def _index(image: str, views: Mapping[str, View]) -> int:
    for index, name in enumerate(views):
        if name == image:
            return index
    raise BadInputError(f"image {image!r} is not among the views; name one of {', '.join(views)}")


def _checked(places: ArrayLike, shape: tuple[int, ...], image: str) -> Floats:
    """Image points of a shape, finite."""
    given = np.asarray(places, float)
    if given.ndim != len(shape) or given.shape[-1] != 2 or not np.isfinite(given).all():
        raise BadInputError(f"image {image!r}: {places!r} is no image point (x, y), or no list of them; correct it")
    return given
