"""Points in space that spots of two or more images may show: pairs by the epipolar gate, verified in all other views.

Nothing is decided here. A spot may belong to several points; which of them are markers, time and body decide.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import chdtri

from analysis.candidates.model import PulseCandidates, Spots
from analysis.identification.space.views import Views, gate
from photogrammetry.geometry.rotation import cross
from photogrammetry.intersection.point_intersection import intersect_points
from rig.arrays import Flags, Floats, Integers

_LIGHT = 0.25  #: standard deviation of a marker's contrast, share of it: light, background and direction change it
_SIZE = 0.35  #: standard deviation of the logarithm of a spot's radius
_DOUBTFUL = 0.95  #: share of true points that fit better than one that may have a wrong ray
_ODDEST = 30.0  #: the greatest chi-square: beyond five standard deviations the model of errors no longer holds


@dataclass(frozen=True, slots=True, eq=False)
class SpacePoints:
    """n points of one pulse.

    Attributes:
        xyz: (n, 3) m.
        covariance: (n, 3, 3) m^2, of spots, poses and marker size.
        rays: (n, m) index of the spot in each camera's image, -1: none.
        misfit: (n,) chi-square of the rays, with twice their number less three degrees of freedom.
    """

    xyz: Floats
    covariance: Floats
    rays: Integers
    misfit: Floats

    def __len__(self) -> int:
        return len(self.xyz)

    @property
    def count(self) -> Integers:
        """(n,) number of rays."""
        return np.asarray((self.rays >= 0).sum(axis=1))

    def only(self, chosen: Integers | Flags) -> "SpacePoints":
        """Some of them."""
        return SpacePoints(self.xyz[chosen], self.covariance[chosen], self.rays[chosen], self.misfit[chosen])

    def joined(self, other: "SpacePoints") -> "SpacePoints":
        """These, then others."""
        pairs = zip(
            (self.xyz, self.covariance, self.rays, self.misfit),
            (other.xyz, other.covariance, other.rays, other.misfit),
            strict=True,
        )
        xyz, covariance, rays, misfit = (np.concatenate(pair) for pair in pairs)
        return SpacePoints(xyz, covariance, rays, misfit)


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """The spots of one image as rays.

    Attributes:
        xy: (n, 2) px.
        covariance: (n, 2, 2) px^2, of the spots alone.
        reduced: (n, 2) without distortion, metric frame.
        variance: (n,) px^2, of a coordinate, with pose and marker size at the scene's centre.
        odd: (n,) chi-square of how much they look unlike the jumper's markers.
    """

    xy: Floats
    covariance: Floats
    reduced: Floats
    variance: Floats
    odd: Floats


@dataclass(frozen=True, slots=True)
class Appearance:
    """What the markers of a jumper look like.

    Attributes:
        contrast: of their spots, grey values.
        sigma: standard deviation of it.
        radius: of their spots, m at the scene's centre.
    """

    contrast: float
    sigma: float
    radius: float

    @classmethod
    def of(cls, contrasts: Floats, radii: Floats) -> "Appearance":
        """The appearance of spots (n,), most of which are markers; radii in m."""
        middle = float(np.median(contrasts))
        spread = 1.48 * float(np.median(np.abs(contrasts - middle)))
        return cls(middle, max(spread, _LIGHT * abs(middle), 1.0), float(np.median(radii)))

    def odd(self, spots: Spots, scale: float) -> Floats:
        """See `Rays.odd`; scale in px per m."""
        light = (spots.contrast - self.contrast) / self.sigma
        size = np.log(np.maximum(spots.radius, 1e-3) / (self.radius * scale)) / _SIZE
        return np.minimum(light**2 + size**2, _ODDEST)


def rays_of(
    views: Views, pulses: Sequence[PulseCandidates], appearance: Appearance | None = None, shift: Floats | None = None
) -> list[list[Rays]]:
    """The spots of each pulse by camera; none where a camera has no image.

    Args:
        views: the cameras.
        pulses: candidates of t pulses.
        appearance: of the jumper's markers, where it is known.
        shift: (t, m, 2) px, what takes spots of the jumper in each image back to the time of the pulse.
    """
    rays: list[list[Rays]] = [[] for _ in pulses]
    if not rays:
        return rays
    counts: list[list[int]] = []
    found: list[Spots] = []
    places: list[Floats] = []
    for k, name in enumerate(views.names):
        images = [candidates.images.get(name) for candidates in pulses]
        of_pulse = [Spots.none() if image is None else image.spots for image in images]
        counts.append([len(spots) for spots in of_pulse])
        found.append(Spots.joined(of_pulse))
        places.append(found[k].xy if shift is None else found[k].xy + np.repeat(shift[:, k], counts[k], axis=0))
    for k, reduced in enumerate(views.reduced(places)):
        spots, xy = found[k], places[k]
        usable = np.asarray(np.isfinite(reduced).all(axis=1))
        variance = np.trace(spots.covariance, axis1=1, axis2=2) / 2 + views.noise[k]
        parts = (
            xy,
            spots.covariance,
            np.where(usable[:, None], reduced, 0.0),
            np.where(usable, variance, np.inf),
            np.zeros(len(spots)) if appearance is None else appearance.odd(spots, float(views.scale[k])),
        )
        ends = np.cumsum(counts[k])[:-1]
        for own, split in zip(rays, zip(*(np.split(part, ends) for part in parts), strict=True), strict=True):
            own.append(Rays(*split))
    return rays


def find_space_points(views: Views, pulses: Sequence[Sequence[Rays]]) -> list[SpacePoints]:
    """All points that rays of two or more cameras may show, pulse by pulse.

    Args:
        views: the cameras.
        pulses: rays of each pulse by camera.
    """
    m = len(views)
    of_pulse, pairs = _epipolar_pairs(views, pulses)
    if not len(pairs):
        return [SpacePoints(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty((0, m), int), np.empty(0)) for _ in pulses]
    solved = _solve(views, pulses, of_pulse, pairs)
    good = np.isfinite(solved.misfit)
    solved, of_pulse = solved.only(good), of_pulse[good]
    full = _solve(views, pulses, of_pulse, _extended(views, pulses, of_pulse, solved))
    allowed = np.array([np.inf, np.inf, *(gate(2 * count - 3) for count in range(2, m + 1))])
    better = full.misfit <= allowed[full.count]
    solved = solved.joined(full).only(np.where(better, len(solved), 0) + np.arange(len(solved)))
    both, first = np.unique(np.column_stack((of_pulse, solved.rays)), axis=0, return_index=True)
    solved, less = solved.only(first), np.unique(_without_one(both, solved.only(first).misfit), axis=0)
    solved = solved.joined(_solve(views, pulses, less[:, 0], less[:, 1:])) if len(less) else solved
    both, first = np.unique(np.concatenate((both, less)), axis=0, return_index=True)
    solved, of_pulse = solved.only(first), both[:, 0]
    return [solved.only((of_pulse == pulse) & np.isfinite(solved.misfit)) for pulse in range(len(pulses))]


def _without_one(points: Integers, misfit: Floats) -> Integers:
    """Points (n, 1 + m), pulse and rays, of three rays or more, without a ray that may be wrong.

    Where a marker is hidden in an image, the thing before it may show a spot near its place. So a ray is left out if
    another point with as many rays has its spot too; and of points that fit badly, each ray in turn.

    Args:
        points: with all their rays.
        misfit: (n,) of these.
    """
    count = (points[:, 1:] >= 0).sum(axis=1)
    several = points[count > 2]
    if not len(several):
        return np.asarray(several)
    left_out = []
    doubtful = misfit[count > 2] > chdtri(2 * count[count > 2] - 3, 1 - _DOUBTFUL)
    for k in range(points.shape[1] - 1):
        spot = several[:, [0, k + 1]]
        _, of_spot, uses = np.unique(spot, axis=0, return_inverse=True, return_counts=True)
        dropped = (spot[:, 1] >= 0) & (doubtful | (uses[of_spot.ravel()] > 1))
        less = several[dropped]
        less[:, k + 1] = -1
        left_out.append(less)
    return np.asarray(np.concatenate(left_out))


def _epipolar_pairs(views: Views, pulses: Sequence[Sequence[Rays]]) -> tuple[Integers, Integers]:
    """Pulse (n,) and rays (n, m) of all pairs of spots whose rays meet within their accuracy."""
    m = len(views)
    of_pulse, found = [np.empty(0, int)], [np.empty((0, m), int)]
    for p, rays in enumerate(pulses):
        vectors = [
            np.column_stack((r.reduced, np.full(len(r.reduced), -camera.c))) @ camera.R.T
            for r, camera in zip(rays, views.ideal, strict=True)
        ]
        for i, j in combinations(range(m), 2):
            if not len(vectors[i]) or not len(vectors[j]):
                continue
            base = views.ideal[j].X0 - views.ideal[i].X0
            across_j, across_i = cross(vectors[j], base), cross(base, vectors[i])
            closure = vectors[i] @ across_j.T
            by_i = ((across_j @ views.ideal[i].R[:, :2]) ** 2).sum(axis=1)
            by_j = ((across_i @ views.ideal[j].R[:, :2]) ** 2).sum(axis=1)
            variance = rays[i].variance[:, None] * by_i + rays[j].variance[:, None].T * by_j[:, None]
            a, b = np.nonzero((closure**2 < gate(1) * variance) & np.isfinite(variance))
            pair = np.full((len(a), m), -1)
            pair[:, i], pair[:, j] = a, b
            found.append(pair)
            of_pulse.append(np.full(len(a), p))
    return np.concatenate(of_pulse), np.concatenate(found)


def _solve(views: Views, pulses: Sequence[Sequence[Rays]], of_pulse: Integers, rays: Integers) -> SpacePoints:
    """Intersect rays (n, m) of their pulses (n,); misfit is NaN where they do not meet before the cameras."""
    n, m = rays.shape
    xy, sigma = np.zeros((n, m, 2)), np.ones((n, m))
    for k in range(m):
        of_camera = [pulse[k] for pulse in pulses]
        first = np.cumsum([0, *(len(r.reduced) for r in of_camera)])
        seen = rays[:, k] >= 0
        at = first[of_pulse[seen]] + rays[seen, k]
        xy[seen, k] = np.concatenate([r.reduced for r in of_camera])[at]
        sigma[seen, k] = np.sqrt(np.concatenate([r.variance for r in of_camera])[at])
    usable = np.isfinite(sigma).all(axis=1)
    sigma[~np.isfinite(sigma)] = 1.0
    meet = intersect_points(views.ideal, xy, seen=rays >= 0, sigma=sigma)
    misfit = np.nansum((meet.residuals / sigma[..., None]) ** 2, axis=(1, 2))
    return SpacePoints(meet.X, meet.covariance, rays, np.where(meet.ok & usable, misfit, np.nan))


def _extended(views: Views, pulses: Sequence[Sequence[Rays]], of_pulse: Integers, pairs: SpacePoints) -> Integers:
    """Rays (n, m) of points seen by pairs, with the nearest spot in the gate of every other camera."""
    full = pairs.rays.copy()
    for k, sight in enumerate(views.see_all(pairs.xyz)):
        spread = sight.by_point @ pairs.covariance @ sight.by_point.transpose(0, 2, 1) + sight.noise
        other = np.asarray((pairs.rays[:, k] < 0) & sight.inside)
        for p in np.unique(of_pulse[other]):
            rays = pulses[p][k]
            if not len(rays.xy):
                continue
            own = np.flatnonzero(other & (of_pulse == p))
            distance = squared_distances(sight.xy[own], spread[own], rays)
            best = distance.argmin(axis=1)
            full[own, k] = np.where(distance[np.arange(len(own)), best] < gate(2), best, -1)
    return full


def squared_distances(xy: Floats, covariance: Floats, rays: Rays) -> Floats:
    """Squared distances (n, spots) in sigmas of predicted image points (n, 2) with covariance (n, 2, 2) from spots."""
    total = covariance[:, None] + rays.covariance
    off = xy[:, None] - rays.xy
    a, b, d = total[..., 0, 0], total[..., 0, 1], total[..., 1, 1]
    x, y = off[..., 0], off[..., 1]
    return np.asarray((d * x * x - 2 * b * x * y + a * y * y) / (a * d - b * b))
