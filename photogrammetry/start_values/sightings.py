"""A network's image observations in the form that the closed solutions take: per image, reduced, each point once."""

from dataclasses import dataclass, replace

import numpy as np

from photogrammetry.geometry.camera_model import undistort
from photogrammetry.network.model import Network
from rig.arrays import Flags, Floats, Integers


@dataclass(frozen=True, slots=True, eq=False)
class Sightings:
    """The points that each image shows, with their image coordinates.

    Attributes:
        camera: (m,) index of each image's camera.
        c: (cameras,) principal distances.
        points: m arrays of point indices, ascending.
        xy: m arrays (n, 2) of ideal image coordinates: principal point and distortion subtracted.
        sigma: m arrays (n,), standard deviations.
        n_points: number of points of the network.
    """

    camera: Integers
    c: Floats
    points: tuple[Integers, ...]
    xy: tuple[Floats, ...]
    sigma: tuple[Floats, ...]
    n_points: int

    @property
    def n_images(self) -> int:
        """Number of images."""
        return len(self.points)

    def c_of(self, image: int) -> float:
        """Principal distance of an image."""
        return float(self.c[self.camera[image]])

    def with_c(self, c: Floats) -> "Sightings":
        """The same sightings with other principal distances (cameras,)."""
        return replace(self, c=c)

    def common(self, first: int, second: int) -> tuple[Integers, Floats, Floats]:
        """Point indices and coordinates in both images of the points that both saw."""
        points, i, j = np.intersect1d(self.points[first], self.points[second], assume_unique=True, return_indices=True)
        return points, self.xy[first][i], self.xy[second][j]

    def seen(self) -> Flags:
        """(m, points) which image saw which point."""
        out = np.zeros((self.n_images, self.n_points), bool)
        for image, points in enumerate(self.points):
            out[image, points] = True
        return out

    def table(self, images: list[int], points: Integers) -> tuple[Floats, Flags, Floats]:
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
        network: its distortion parameters are used as given, and ignored at points where they have no inverse.

    Returns:
        The sightings; if an image has two measurements of a point, the first.
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
