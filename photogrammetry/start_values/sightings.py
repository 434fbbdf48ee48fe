"""A network's image observations as the closed solutions want them: per image, ideal coordinates, each point once."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from photogrammetry.camera_model import undistort
from photogrammetry.ideal_camera import Array
from photogrammetry.network import Network

Integers = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Sightings:
    """What each image saw.

    Attributes:
        camera: (m,) index of each image's camera.
        c: (cameras,) principal distances.
        points: m arrays of point indices, ascending.
        xy: m arrays (n, 2) of ideal image coordinates: principal point and distortion taken off.
        sigma: m arrays (n,), standard deviations.
        n_points: number of points of the network.
    """

    camera: Integers
    c: Array
    points: tuple[Integers, ...]
    xy: tuple[Array, ...]
    sigma: tuple[Array, ...]
    n_points: int

    @property
    def n_images(self) -> int:
        """Number of images."""
        return len(self.points)

    def c_of(self, image: int) -> float:
        """Principal distance of an image."""
        return float(self.c[self.camera[image]])

    def with_c(self, c: Array) -> "Sightings":
        """The same sightings with other principal distances (cameras,)."""
        return replace(self, c=c)

    def of_images(self, images: list[int]) -> "Sightings":
        """The sightings of some images, in that order; cameras and points keep their numbers."""
        return replace(
            self,
            camera=self.camera[images],
            points=tuple(self.points[i] for i in images),
            xy=tuple(self.xy[i] for i in images),
            sigma=tuple(self.sigma[i] for i in images),
        )

    def common(self, first: int, second: int) -> tuple[Integers, Array, Array]:
        """Point indices and coordinates in both images of the points that both saw."""
        points, i, j = np.intersect1d(self.points[first], self.points[second], assume_unique=True, return_indices=True)
        return points, self.xy[first][i], self.xy[second][j]

    def seen(self) -> NDArray[np.bool_]:
        """(m, points) which image saw which point."""
        out = np.zeros((self.n_images, self.n_points), bool)
        for image, points in enumerate(self.points):
            out[image, points] = True
        return out

    def table(self, images: list[int], points: Integers) -> tuple[Array, NDArray[np.bool_], Array]:
        """Coordinates (n, m, 2), existence (n, m) and sigmas (n, m) of some points in some images."""
        column = np.full(self.n_points, -1)
        column[points] = np.arange(len(points))
        shape = (len(points), len(images))
        xy, seen, sigma = np.zeros((*shape, 2)), np.zeros(shape, bool), np.ones(shape)
        for j, image in enumerate(images):
            rows = column[self.points[image]]
            there = rows >= 0
            xy[rows[there], j] = self.xy[image][there]
            seen[rows[there], j] = True
            sigma[rows[there], j] = self.sigma[image][there]
        return xy, seen, sigma


def reduce_observations(network: Network) -> Sightings:
    """Ideal coordinates of all observations with the network's interior orientations.

    Args:
        network: its distortion parameters are taken as they stand; where they have no inverse they are left out.

    Returns:
        The sightings; of a point measured twice in an image the first measurement.
    """
    seen = network.observations
    points, xy, sigma = [], [], []
    for index, image in enumerate(network.images):
        rows = np.flatnonzero(seen.image == index)
        unique, first = np.unique(seen.point[rows], return_index=True)
        rows = rows[first]
        camera = network.cameras[image.camera]
        ideal = undistort(camera.lens(), seen.xy[rows])
        ideal = np.where(np.isfinite(ideal), ideal, seen.xy[rows] - camera.interior[1:3])
        points.append(unique)
        xy.append(ideal)
        sigma.append(seen.sigma[rows].mean(axis=1))
    cameras = np.array([image.camera for image in network.images], np.intp)
    c = np.array([camera.interior[0] for camera in network.cameras])
    return Sightings(cameras, c, tuple(points), tuple(xy), tuple(sigma), len(network.points))
