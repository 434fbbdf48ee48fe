"""A block of oriented images and intersected points: how it begins and how it grows (the paper's steps 1Ba to 1Bc).

`seed_block` orients a well-chosen pair of images relatively. `ImageBlock.grow` then takes turns: it intersects points
from the images that have a pose, and resects images from the points that have coordinates, until nothing more can be
added.
"""

from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.geometry.similarity import Similarity
from photogrammetry.intersection.point_intersection import PointState, intersect_points
from photogrammetry.start_values.relative_orientation import RelativeOrientation, orient_relatively
from photogrammetry.start_values.resection import Resection, refine_pose, resect
from photogrammetry.start_values.sightings import Sightings
from rig.arrays import Flags, Floats
from rig.errors import BadInputError

_LEVELS = (8, 6, 4, 3)  # known points that an image must see: the well-determined images come first
_OUTLIER = 4.0  # times the median residual: a resection leaves out points with larger ones
_GOOD_SHARE, _LEAST_POINTS = 0.8, 6  # but keeps this share of the points, and at least so many
_CAUTION = 30.0  # poses are start values, so rays are that much less accurate than the image points
_POLISH_ROUNDS = 2
_QUANTILE, _QUANTILE_SQUARE = 0.8, 3.219  # quantile of squared residuals, and its value for two standard normal numbers
_MIN_COMMON = 5
_ORIENTED = 16  # pairs whose relative orientation is computed
_TRIED = 3  # pairs from which a trial block is grown
_TRIAL_IMAGES = 4
_ENOUGH_COMMON = 30  # more common points do not raise the score of a pair
_ENOUGH_PARALLAX = 0.5  # rad; a larger angle between the rays does not either


@dataclass(slots=True, eq=False)
class ImageBlock:
    """Poses and points in one system.

    Attributes:
        sightings: of all images.
        cameras: pose of each oriented image, by its index.
        xyz: (points, 3) coordinates, NaN where unknown.
        held: (points,) whose coordinates are given and stay.
        settled: indices of images whose pose is given and stays.
    """

    sightings: Sightings
    cameras: dict[int, IdealCamera] = field(default_factory=dict)
    xyz: Floats = field(default_factory=lambda: np.empty((0, 3)))
    held: Flags = field(default_factory=lambda: np.empty(0, bool))
    settled: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        if not len(self.xyz):
            self.xyz = np.full((self.sightings.n_points, 3), np.nan)
            self.held = np.zeros(self.sightings.n_points, bool)

    @property
    def known(self) -> Flags:
        """(points,) which points have coordinates."""
        return np.asarray(np.isfinite(self.xyz[:, 0]))

    def with_c(self, c: Floats) -> "ImageBlock":
        """A copy with other principal distances (cameras,)."""
        sightings = self.sightings.with_c(c)
        cameras = {i: replace(camera, c=sightings.c_of(i)) for i, camera in self.cameras.items()}
        return ImageBlock(sightings, cameras, self.xyz.copy(), self.held.copy(), set(self.settled))

    def grow(self, most_images: int | None = None, polish: bool = True) -> None:
        """Intersect and resect in turns until nothing more can be added.

        Args:
            most_images: stop when so many images are oriented; no limit if left out.
            polish: at the end, improve all poses and points with all rays.
        """
        self.intersect()
        while most_images is None or len(self.cameras) < most_images:
            if not self._resect_wave(most_images):
                break
            self.intersect()
        if polish:
            self.polish()

    def intersect(self, again: bool = False, caution: float = _CAUTION) -> None:
        """Coordinates of all points with two or more rays; with `again` also of those that have some already.

        Leaves out points that rays `caution` times less accurate than the image points would not determine.
        """
        images = sorted(self.cameras)
        seen = self.sightings.seen()[images] if images else np.zeros((0, self.sightings.n_points), bool)
        wanted = ~self.held & (seen.sum(axis=0) >= 2)
        points = np.flatnonzero(wanted if again else wanted & ~self.known)
        if not len(points):
            return
        xy, there, sigma = self.sightings.table(images, points)
        cameras = [self.cameras[image] for image in images]
        result = intersect_points(cameras, xy, seen=there, sigma=sigma * caution)
        good = np.asarray(result.state == PointState.OK)
        self.xyz[points[good]] = result.X[good]

    def polish(self) -> None:
        """Resection from all points and intersection from all rays, in turns."""
        for _ in range(_POLISH_ROUNDS):
            for image, camera in self.cameras.items():
                points, xy = self._known_points(image)
                if len(points) >= 4 and image not in self.settled:
                    size = np.linalg.norm(camera.project(points) - xy, axis=1)
                    good = np.argsort(size)[: max(_LEAST_POINTS, int(_GOOD_SHARE * len(size)))]
                    good = np.union1d(good, np.flatnonzero(size <= _OUTLIER * np.median(size)))
                    refined = refine_pose(camera, points[good], xy[good], steps=5)
                    if np.isfinite(refined.square_sum):
                        self.cameras[image] = refined.camera
            self.intersect(again=True)

    def residual(self) -> float:
        """Root mean square of the residuals of all rays to known points over their sigmas, each at most 100."""
        every = self._squares()
        return float(np.sqrt(np.minimum(every, 1e4).mean())) if len(every) else np.inf

    def typical_residual(self) -> float:
        """A robust `residual`, from the size that four fifths of the residuals do not exceed."""
        every = self._squares()
        return float(np.sqrt(2.0 * np.quantile(every, _QUANTILE) / _QUANTILE_SQUARE)) if len(every) else np.inf

    def _squares(self) -> Floats:
        """Squared residuals of all rays to known points over their variances."""
        squares = [np.zeros(0)]
        for image, camera in self.cameras.items():
            known = self.known[self.sightings.points[image]]
            v = camera.project(self.xyz[self.sightings.points[image][known]]) - self.sightings.xy[image][known]
            squares.append(((v / self.sightings.sigma[image][known, None]) ** 2).sum(axis=1))
        return np.nan_to_num(np.concatenate(squares), nan=1e4)

    def transform(self, similarity: Similarity) -> None:
        """Carry the block into another system."""
        self.xyz = similarity.apply(self.xyz)
        for image, camera in self.cameras.items():
            moved = similarity.apply(camera.X0)
            self.cameras[image] = IdealCamera(camera.c, moved, similarity.turn(camera.R))

    def _known_points(self, image: int) -> tuple[Floats, Floats]:
        known = self.known[self.sightings.points[image]]
        return self.xyz[self.sightings.points[image][known]], self.sightings.xy[image][known]

    def _resect_wave(self, most_images: int | None) -> bool:
        """Orient all images that see enough known points, at the highest level that any of them reaches."""
        missing = [image for image in range(self.sightings.n_images) if image not in self.cameras]
        counts = {image: int(self.known[self.sightings.points[image]].sum()) for image in missing}
        for level in _LEVELS:
            ready = sorted((image for image in missing if counts[image] >= level), key=lambda i: (-counts[i], i))
            if most_images is not None:
                ready = ready[: most_images - len(self.cameras)]
            added = [self._resect(image) for image in ready]
            if any(added):
                return True
        return False

    def _resect(self, image: int) -> bool:
        points, xy = self._known_points(image)
        c = self.sightings.c_of(image)
        try:
            result = resect(points, xy, c)
            size = np.linalg.norm(result.residuals, axis=1)
            least = max(_LEAST_POINTS, int(_GOOD_SHARE * len(points)))
            while len(points) > least and size.max() > _OUTLIER * np.median(size):
                keep = np.arange(len(points)) != size.argmax()
                points, xy = points[keep], xy[keep]
                result = resect(points, xy, c)
                size = np.linalg.norm(result.residuals, axis=1)
        except BadInputError:
            return False  # points on a line, or that fit no pose: retried when more points are known
        self.cameras[image] = self._chosen(image, result)
        return True

    def _chosen(self, image: int, result: Resection) -> IdealCamera:
        """Of several possible poses the one that fits best the rays to points that are not known yet."""
        if not result.ambiguous or not self.cameras:
            return result.camera
        others = sorted(self.cameras)
        seen_elsewhere = np.asarray(self.sightings.seen()[others].any(axis=0))
        points = self.sightings.points[image]
        points = points[~self.known[points] & seen_elsewhere[points]]
        if not len(points):
            return result.camera
        xy, there, sigma = self.sightings.table([image, *others], points)

        def misfit(camera: IdealCamera) -> float:
            cameras = [camera, *(self.cameras[other] for other in others)]
            crossing = intersect_points(cameras, xy, seen=there, sigma=sigma)
            square = np.nansum(crossing.residuals**2, axis=(1, 2))
            return float(np.median(np.where(crossing.ok, square, np.inf)))

        return min((result.camera, *result.alternatives), key=misfit)


@dataclass(frozen=True, slots=True, eq=False)
class _Pair:
    first: int
    second: int
    orientation: RelativeOrientation
    score: float


def seed_block(sightings: Sightings, images: list[int]) -> ImageBlock | None:
    """Orient the most promising pair of images.

    The number of common points and the angle between their rays score the pairs. From the best pairs, trial blocks of a
    few images are grown, one for each possible relative orientation; the one with the smallest residuals is taken.

    Args:
        sightings: of all images.
        images: indices of the images to choose from.

    Returns:
        The best trial block, in the system of one of its images and with a base of length 1; None if no pair has five
        common points and a relative orientation.
    """
    pairs = _pairs(sightings, images)
    trials = [
        (pair, solution) for pair in pairs[:_TRIED] for solution in (pair.orientation, *pair.orientation.alternatives)
    ]
    if not trials:
        return None
    blocks = []
    for pair, solution in trials:
        trial = _block(sightings, pair, solution)
        trial.grow(most_images=_TRIAL_IMAGES)
        blocks.append(trial)
    return min(blocks, key=lambda block: block.residual() / np.sqrt(len(block.cameras)))


def _pairs(sightings: Sightings, images: list[int]) -> list[_Pair]:
    seen = sightings.seen().astype(int)
    counts = seen @ seen.T
    candidates = [(i, j) for i, j in combinations(images, 2) if counts[i, j] >= _MIN_COMMON]
    candidates.sort(key=lambda pair: (-min(int(counts[pair]), _ENOUGH_COMMON), pair))
    found = []
    for first, second in _spread(candidates):
        _, a, b = sightings.common(first, second)
        try:
            orientation = orient_relatively(a, b, sightings.c_of(first), sightings.c_of(second))
        except BadInputError:
            continue  # no solution for this pair
        score = min(len(a), _ENOUGH_COMMON) * min(orientation.parallax, _ENOUGH_PARALLAX) * orientation.in_front
        found.append(_Pair(first, second, orientation, score / (1 + len(orientation.alternatives))))
    return sorted(found, key=lambda pair: -pair.score)


def _spread(candidates: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The first candidates, with each image in at most four of them."""
    chosen: list[tuple[int, int]] = []
    uses: dict[int, int] = {}
    for pair in candidates:
        if len(chosen) < _ORIENTED and all(uses.get(image, 0) < 4 for image in pair):
            chosen.append(pair)
            for image in pair:
                uses[image] = uses.get(image, 0) + 1
    return chosen


def _block(sightings: Sightings, pair: _Pair, solution: RelativeOrientation) -> ImageBlock:
    block = ImageBlock(sightings)
    cameras = solution.cameras(sightings.c_of(pair.first), sightings.c_of(pair.second))
    block.cameras = dict(zip((pair.first, pair.second), cameras, strict=True))
    return block
