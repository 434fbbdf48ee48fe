"""A block of oriented images and intersected points, and how it grows: the paper's steps 1Bb and 1Bc.

Points are intersected from the images that have a pose, images are resected from the points that have coordinates, in
turns, until nothing more can be added.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from photogrammetry.ideal_camera import Array, IdealCamera
from photogrammetry.intersection.point_intersection import PointState, intersect_points
from photogrammetry.similarity import Similarity
from photogrammetry.start_values.pose_refinement import refine_pose
from photogrammetry.start_values.resection import Resection, resect
from photogrammetry.start_values.sightings import Sightings
from rig.errors import BadInputError

_LEVELS = (8, 6, 4, 3)  # known points that an image must see: the well-determined images come first
_OUTLIER = 4.0  # residual over the median residual beyond which a point is left out of a resection,
_GOOD_SHARE, _LEAST_POINTS = 0.8, 6  # as long as so many remain
_CAUTION = 30.0  # poses are start values: the rays are less accurate than the image points
_POLISH_ROUNDS = 2
_USUAL, _USUAL_SQUARE = 0.8, 3.219  # quantile of squared residuals, and its value for two standard normal numbers


@dataclass(slots=True, eq=False)
class ImageBlock:
    """Poses and points in one system.

    Attributes:
        sightings: what the images saw.
        cameras: pose of each oriented image, by its index.
        xyz: (points, 3) coordinates, NaN where unknown.
        held: (points,) whose coordinates are given and not touched.
        settled: images whose pose is given and not touched.
    """

    sightings: Sightings
    cameras: dict[int, IdealCamera] = field(default_factory=dict)
    xyz: Array = field(default_factory=lambda: np.empty((0, 3)))
    held: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, bool))
    settled: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        if not len(self.xyz):
            self.xyz = np.full((self.sightings.n_points, 3), np.nan)
            self.held = np.zeros(self.sightings.n_points, bool)

    @property
    def known(self) -> NDArray[np.bool_]:
        """(points,) which points have coordinates."""
        return np.asarray(np.isfinite(self.xyz[:, 0]))

    def with_c(self, c: Array) -> "ImageBlock":
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

        Points that would not be determined by rays `caution` times less accurate than the image points are left.
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
        """Root mean square of the residuals of all rays to known points over their sigmas, blunders cut at 100."""
        every = self._squares()
        return float(np.sqrt(np.minimum(every, 1e4).mean())) if len(every) else np.inf

    def typical_residual(self) -> float:
        """The same by the residual that four fifths of the rays do not exceed: a few blunders do not change it."""
        every = self._squares()
        return float(np.sqrt(2.0 * np.quantile(every, _USUAL) / _USUAL_SQUARE)) if len(every) else np.inf

    def _squares(self) -> Array:
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

    def _known_points(self, image: int) -> tuple[Array, Array]:
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
            return False  # points on a line, or that fit no pose: other points may come
        self.cameras[image] = self._chosen(image, result)
        return True

    def _chosen(self, image: int, result: Resection) -> IdealCamera:
        """Of several possible poses the one that fits the rays to points that are not known yet."""
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
