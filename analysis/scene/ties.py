"""Finds balls that nobody surveyed: detections of several oriented images whose rays meet in a point.

Pairs of detections are intersected (paper, appendix C.1), each pair that meets is looked for in all other images, and
what agrees by chi-squared with the covariances of measurement and pose is a ball. It must be as large in space as the
others, because trees and people have round spots too. Where three images or more are oriented, three rays are asked
for: two rays meet too easily. A detection that two balls could claim belongs to neither.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import chdtri

from analysis.scene.naming import GATE, MODEL_SIGMA, Spots
from analysis.scene.single_pose import SinglePose, predict
from photogrammetry.geometry.camera_model import undistort
from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.intersection.point_intersection import intersect_points
from photogrammetry.network.model import Camera
from rig.arrays import Floats, Integers

_PAIR_GATE = float(chdtri(1, 0.001))
_ALIKE = 1.5  # ratio of the sizes of one ball in space, as two images measure them
_LIKE_OTHERS = 1.6  # ratio of a ball's size to that of the others
_RIVAL = 8.0  # chi-squared by which a rival is worse if it is none


@dataclass(frozen=True, slots=True, eq=False)
class Station:
    """An oriented image with its detections.

    Attributes:
        camera: interior orientation.
        pose: with its covariance.
        spots: all detections.
        radius: (n,) of the detections, px.
        free: indices of those that have no name.
    """

    camera: Camera
    pose: SinglePose
    spots: Spots
    radius: Floats
    free: Integers

    def ideal(self) -> IdealCamera:
        """The camera of the closed solutions."""
        return IdealCamera(float(self.camera.interior[0]), self.pose.position, self.pose.rotation)

    def reduced(self) -> Floats:
        """Ideal coordinates (n, 2) of all detections; NaN where the distortion has no inverse."""
        return undistort(self.camera.lens(), self.spots.xy)

    def size_at(self, spot: int, xyz: Floats) -> float:
        """Radius in space of a detection that is at a point."""
        return float(self.radius[spot] * np.linalg.norm(xyz - self.pose.position) / self.camera.interior[0])


@dataclass(frozen=True, slots=True, eq=False)
class Tie:
    """A ball without a name.

    Attributes:
        xyz: (3,) coordinates.
        covariance: (3, 3).
        rays: detection by index of the station.
        square_sum: of the normalized residuals.
    """

    xyz: Floats
    covariance: Floats
    rays: dict[int, int]
    square_sum: float


def find_ties(stations: Sequence[Station], ball_radius: float | None = None) -> list[Tie]:
    """The balls that the unnamed detections show.

    Args:
        stations: oriented images, two or more.
        ball_radius: of a ball in space, where it is known from named ones.

    Returns:
        Balls along the first axis of the object system.
    """
    fewest = min(3, len(stations))
    groups: dict[tuple[tuple[int, int], ...], Tie] = {}
    for a, b in combinations(range(len(stations)), 2):
        for xyz, covariance, rays in _meeting(stations, a, b):
            for c in range(len(stations)):
                hit = None if c in rays else _hit(stations[c], xyz, covariance)
                if hit is not None:
                    rays[c] = hit
            key = tuple(sorted(rays.items()))
            if len(rays) < fewest or key in groups:
                continue
            tie = _intersected(stations, rays)
            if tie is not None and _is_ball(stations, tie, ball_radius):
                groups[key] = tie
    return sorted(_without_rivals(list(groups.values())), key=lambda tie: tuple(tie.xyz))


def ball_size(stations: Sequence[Station], named: Sequence[tuple[int, int, Floats]]) -> float | None:
    """Median radius in space of named balls: station, detection, coordinates; None if they are too few."""
    sizes = [stations[station].size_at(spot, xyz) for station, spot, xyz in named]
    return float(np.median(sizes)) if len(sizes) >= 4 else None


def _sigmas(station: Station, spots: Integers, xyz: Floats) -> Floats:
    """(n,) standard deviation of the rays of detections near a point, pose included, px."""
    _, _, from_pose = predict(station.camera.lens(), station.pose, xyz[None], np.zeros((1, 3, 3)))
    total = station.spots.covariance[spots] + np.nan_to_num(from_pose) + MODEL_SIGMA**2 * np.eye(2)
    return np.asarray(np.sqrt(np.trace(total, axis1=1, axis2=2) / 2))


def _meeting(stations: Sequence[Station], a: int, b: int) -> Iterator[tuple[Floats, Floats, dict[int, int]]]:
    """Pairs of detections whose rays meet: point, covariance, rays."""
    one, two = stations[a], stations[b]
    i, j = (grid.ravel() for grid in np.meshgrid(one.free, two.free, indexing="ij"))
    xy = np.stack((one.reduced()[i], two.reduced()[j]), axis=1)
    sound = np.isfinite(xy).all(axis=(1, 2))
    i, j, xy = i[sound], j[sound], xy[sound]
    if not len(i):
        return
    # the poses' part of a ray's sigma varies slowly over the image: it is taken in the middle of the scene
    middle = _middle(one, two)
    sigma = np.stack((_sigmas(one, i, middle), _sigmas(two, j, middle)), axis=1)
    points = intersect_points([one.ideal(), two.ideal()], xy, sigma=sigma)
    with np.errstate(invalid="ignore"):
        squares = (points.residuals**2 / sigma[:, :, None] ** 2).sum(axis=(1, 2))
    for k in np.flatnonzero(points.ok & (squares < _PAIR_GATE)):
        yield points.X[k], points.covariance[k], {a: int(i[k]), b: int(j[k])}


def _middle(one: Station, two: Station) -> Floats:
    """The point between two optical axes, where they are nearest to each other."""
    directions = np.stack((-one.pose.rotation[:, 2], -two.pose.rotation[:, 2]), axis=1)
    base = two.pose.position - one.pose.position
    lengths, *_ = np.linalg.lstsq(directions * (1.0, -1.0), base, rcond=None)
    return np.asarray(one.pose.position + max(float(lengths[0]), 1e-3) * directions[:, 0], float)


def _hit(station: Station, xyz: Floats, covariance: Floats) -> int | None:
    """The unnamed detection at a point, None if there is none."""
    if not len(station.free):
        return None
    xy, from_point, from_pose = predict(station.camera.lens(), station.pose, xyz[None], covariance[None])
    if not np.isfinite(xy).all():
        return None
    off = station.spots.xy[station.free] - xy[0]
    total = station.spots.covariance[station.free] + from_point[0] + from_pose[0] + MODEL_SIGMA**2 * np.eye(2)
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(total), off)
    best = int(squares.argmin())
    return int(station.free[best]) if squares[best] < GATE else None


def _intersected(stations: Sequence[Station], rays: dict[int, int]) -> Tie | None:
    """The point of all these rays; None if they do not agree."""
    chosen = sorted(rays)
    xy = np.array([stations[s].reduced()[rays[s]] for s in chosen])[None]
    middle = _middle(stations[chosen[0]], stations[chosen[1]])
    sigma = np.array([_sigmas(stations[s], np.array([rays[s]]), middle)[0] for s in chosen])
    point = intersect_points([stations[s].ideal() for s in chosen], xy, sigma=sigma)
    if not point.ok[0]:
        return None
    squares = float((point.residuals[0] ** 2 / sigma[:, None] ** 2).sum())
    if squares > chdtri(2 * len(chosen) - 3, 0.001):
        return None
    return Tie(point.X[0], point.covariance[0], dict(rays), squares)


def _is_ball(stations: Sequence[Station], tie: Tie, ball_radius: float | None) -> bool:
    sizes = [stations[station].size_at(spot, tie.xyz) for station, spot in tie.rays.items()]
    if max(sizes) > _ALIKE * min(sizes):
        return False
    return ball_radius is None or bool(1 / _LIKE_OTHERS < np.median(sizes) / ball_radius < _LIKE_OTHERS)


def _without_rivals(ties: Sequence[Tie]) -> list[Tie]:
    """Each detection in one ball at most; where two balls fit it nearly alike, in none."""
    ordered = sorted(ties, key=lambda tie: (-len(tie.rays), tie.square_sum))
    kept: list[Tie] = []
    doubtful: list[Tie] = []
    for tie in ordered:
        others = [other for other in (*kept, *doubtful) if set(other.rays.items()) & set(tie.rays.items())]
        if not others:
            kept.append(tie)
            continue
        doubtful.append(tie)
        for other in others:
            equal = len(other.rays) == len(tie.rays) and tie.square_sum < other.square_sum + _RIVAL
            if equal and other in kept:
                kept.remove(other)
                doubtful.append(other)
    return kept
