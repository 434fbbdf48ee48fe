"""Poses of one image that make many surveyed balls appear where something round was found, without any start value.

Every ordered triple of detections is tried on a triple of surveyed balls (three-point resection; at most four poses
each); a pose is worth a closer look if many other surveyed balls fall onto detections too. Triples of surveyed balls
are tried one after the other, well spread ones first and each with other balls, because some may be out of sight.
Nothing is drawn at random: the same input gives the same result.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from analysis.scene.three_points import poses_from_three_points
from photogrammetry.geometry.ideal_camera import unit_rays
from photogrammetry.geometry.rotation import cross
from rig.arrays import Flags, Floats, Integers

_HIT_SHARE = 0.008  # of the image's width: a projected ball so near to a detection is a hit
_APART = 0.02  # of the image's width: two balls of a triple are at least so far from each other in the image
_BORDER = 1.3  # the map of detections is so much larger than the image, because distortion is taken out
_CHUNK = 8192  # triples at a time
_KEPT = 24  # poses of one triple that are returned
_ENOUGH_OTHERS = 6  # surveyed balls beside a triple, from which on every other one is looked at first
_COLLINEAR = 0.02  # height of a triangle over its longest side


@dataclass(frozen=True, slots=True, eq=False)
class Approximate:
    """An approximate pose.

    Attributes:
        position: (3,) X0.
        rotation: (3, 3).
        distance: the true X0 is not farther from it than this, object unit.
        angle: nor turned by more than this, rad.
    """

    position: Floats
    rotation: Floats
    distance: float
    angle: float

    def admits(self, position: Floats, rotation: Floats) -> Flags:
        """Which of n poses (n, 3), (n, 3, 3) are near enough."""
        cosine = (np.einsum("ij,nij->n", self.rotation, rotation) - 1) / 2
        near = np.linalg.norm(position - self.position, axis=1) <= self.distance
        return np.asarray(near & (cosine >= np.cos(self.angle)))


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A pose, and which surveyed balls it puts onto which detections.

    Attributes:
        position, rotation: the pose.
        points: (k,) indices of surveyed balls.
        detections: (k,) of detections.
    """

    position: Floats
    rotation: Floats
    points: Integers
    detections: Integers


class Search:
    """The hypotheses of one image.

    Args:
        points: (n, 3) surveyed balls.
        xy: (m, 2) ideal coordinates of the detections, best first: metric, principal point and distortion subtracted.
        c: principal distance.
        size: width and height of the image.
        approximate: limits the poses.

    Attributes:
        tried: number of poses that were compared with the detections.
        triples: number of triples of balls that were tried.
    """

    def __init__(
        self, points: Floats, xy: Floats, c: float, size: tuple[int, int], approximate: Approximate | None = None
    ) -> None:
        self._points, self._xy, self._c, self._width = points, xy, c, size[0]
        self._approximate = approximate
        self._rays = unit_rays(xy, c)
        self._map = _map(xy, size)
        self._first, self._at_first = np.zeros(0, np.intp), 0
        self.tried = self.triples = 0

    def of_triple(self, triple: Integers, most: int) -> list[Hypothesis]:
        """The best hypotheses in which the surveyed balls `triple` (3,) are among the `most` best detections."""
        self.triples += 1
        others = np.setdiff1d(np.arange(len(self._points)), triple)
        self._first, self._at_first = (others[::2], 1) if len(others) >= _ENOUGH_OTHERS else (others, 0)
        found: list[tuple[int, int, Hypothesis]] = []
        for chosen in self._image_triples(triple, most):
            position, rotation, _ = poses_from_three_points(self._points[triple][None], self._rays[chosen])
            found += self._promising(position, rotation, len(found))
            found.sort(key=lambda entry: entry[:2])
            del found[_KEPT:]
        return [hypothesis for _, _, hypothesis in found]

    def of_detections(self, detections: Integers) -> list[Hypothesis]:
        """The best hypotheses in which three detections (3,) are any three surveyed balls; not counted in `tried`."""
        tried = self.tried
        self._first, self._at_first = np.arange(len(self._points)), 4
        found: list[tuple[int, int, Hypothesis]] = []
        every = _ordered_triples(len(self._points))
        for first in range(0, len(every), _CHUNK):
            points = self._points[every[first : first + _CHUNK]]
            position, rotation, _ = poses_from_three_points(points, self._rays[detections][None])
            found += self._promising(position, rotation, len(found))
            found.sort(key=lambda entry: entry[:2])
            del found[_KEPT:]
        self.tried = tried
        return [hypothesis for _, _, hypothesis in found]

    def _image_triples(self, triple: Integers, most: int) -> Iterator[Integers]:
        """Ordered triples of detections (k, 3), in chunks, without those that cannot be."""
        n = min(most, len(self._xy))
        allowed = _ordered_triples(n)
        far = np.linalg.norm(self._xy[:n, None] - self._xy[None, :n], axis=2) > _APART * self._width
        i, j, k = allowed.T
        keep = far[i, j] & far[j, k] & far[i, k]
        if self._approximate is not None:
            keep &= self._near_the_expected(self._approximate, triple, allowed)
        allowed = allowed[keep]
        for first in range(0, len(allowed), _CHUNK):
            yield allowed[first : first + _CHUNK]

    def _near_the_expected(self, pose: Approximate, triple: Integers, detections: Integers) -> Flags:
        """Whether balls can be there: an approximate pose shifts all of them much, but nearly alike."""
        k = (self._points[triple] - pose.position) @ pose.rotation
        if (k[:, 2] >= -pose.distance).any():
            return np.ones(len(detections), bool)
        expected = -self._c * k[:, :2] / k[:, 2:]
        depth = float(-k[:, 2].max())
        shift = self._xy[detections] - expected
        turn = min(pose.angle, 1.0)
        radius = float(np.hypot(expected, self._width / 2).max())
        sideways = self._c * pose.distance / (depth - pose.distance)
        limit = 1.5 * self._c * np.tan(turn) + sideways
        parallax = float(np.ptp(k[:, 2])) / depth + float(np.ptp(expected, axis=0).max()) / self._c
        unlike = 1.5 * turn * radius + 2 * sideways * parallax + 0.02 * self._width
        near = (np.linalg.norm(shift, axis=2) < limit).all(axis=1)
        alike = (np.linalg.norm(shift - shift.mean(axis=1, keepdims=True), axis=2) < unlike).all(axis=1)
        return np.asarray(near & alike)

    def _promising(self, position: Floats, rotation: Floats, order: int) -> list[tuple[int, int, Hypothesis]]:
        """Of n poses those with the most hits, with negative number of hits and order for sorting."""
        if self._approximate is not None:
            near = self._approximate.admits(position, rotation)
            position, rotation = position[near], rotation[near]
        self.tried += len(position)
        if not len(position):
            return []
        # most poses put none of the first balls onto a detection: they are not worth the others
        some = (self._hits(position, rotation, self._first) >= 0).sum(axis=1) >= self._at_first
        position, rotation = position[some], rotation[some]
        hit = self._hits(position, rotation, np.arange(len(self._points)))
        count = (hit >= 0).sum(axis=1)
        best = np.argsort(-count, kind="stable")[:_KEPT]
        found = []
        for rank, i in enumerate(best[count[best] >= 4]):
            points = np.flatnonzero(hit[i] >= 0)
            detections, first = np.unique(hit[i][points], return_index=True)
            if len(detections) >= 4:
                chosen = Hypothesis(position[i], rotation[i], points[first], detections)
                found.append((-len(detections), order + rank, chosen))
        return found

    def _hits(self, position: Floats, rotation: Floats, points: Integers) -> NDArray[np.int16]:
        """The detection (n, points) that each of some surveyed balls falls onto in each pose, -1: none."""
        # k = R^T (X - X0), as one matrix product for all poses; single precision is exact to 0.001 px
        middle = self._points.mean(axis=0)
        shift = np.einsum("nij,ni->nj", rotation, middle - position)
        matrix = np.concatenate((rotation.transpose(0, 2, 1), shift[:, :, None]), axis=2).astype(np.float32)
        balls = np.column_stack((self._points[points] - middle, np.ones(len(points)))).astype(np.float32)
        k = (matrix.reshape(-1, 4) @ balls.T).reshape(-1, 3, len(points))
        rows, columns = self._map.shape
        with np.errstate(all="ignore"):
            scale = np.float32(-self._c) / k[:, 2]
            x = k[:, 0] * scale + np.float32(columns / 2)
            y = np.float32(rows / 2) - k[:, 1] * scale
            inside = (k[:, 2] < 0) & (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        x, y = np.where(inside, x, 0).astype(np.int32), np.where(inside, y, 0).astype(np.int32)
        return np.asarray(np.where(inside, self._map[y, x], -1), np.int16)


def spread_triples(points: Floats, most: int) -> list[Integers]:
    """Up to `most` triples of points (n, 3): large triangles, and each point in about as many of them."""
    triples = np.array(list(combinations(range(len(points)), 3)), np.intp).reshape(-1, 3)
    corners = points[triples]
    sides = corners - np.roll(corners, 1, axis=1)
    longest = (sides**2).sum(axis=2).max(axis=1)
    area = np.linalg.norm(cross(sides[:, 0], sides[:, 1]), axis=1)
    good = area > _COLLINEAR * longest
    triples, area = triples[good], area[good]
    chosen: list[Integers] = []
    used = np.zeros(len(points))
    while len(chosen) < most and len(triples):
        worth = np.sqrt(area) / (1.0 + used[triples].sum(axis=1)) ** 2
        best = int(worth.argmax())
        chosen.append(triples[best])
        used[triples[best]] += 1
        triples, area = np.delete(triples, best, axis=0), np.delete(area, best)
    return chosen


@lru_cache(maxsize=4)
def _ordered_triples(n: int) -> Integers:
    return np.array(list(permutations(range(n), 3)), np.intp).reshape(-1, 3)


def _map(xy: Floats, size: tuple[int, int]) -> NDArray[np.int16]:
    """The nearest detection at each pixel (y down) around the image centre, -1 where none is near."""
    columns, rows = (int(_BORDER * side) // 2 * 2 + 1 for side in size)
    nearest = np.full((rows, columns), -1, np.int16)
    radius = _HIT_SHARE * size[0]
    distance = np.full((rows, columns), radius)
    reach = int(radius) + 1
    for i, (x, y) in enumerate(xy):
        column, row = x + (columns - 1) / 2, (rows - 1) / 2 - y
        if not (0 <= column < columns and 0 <= row < rows):
            continue
        r, c = (slice(max(0, round(v) - reach), round(v) + reach + 1) for v in (row, column))
        part = distance[r, c]
        yy, xx = np.mgrid[r.start : r.start + part.shape[0], c.start : c.start + part.shape[1]]
        here = np.hypot(xx - column, yy - row)
        closer = here < part
        part[closer] = here[closer]
        nearest[r, c][closer] = i
    return nearest
