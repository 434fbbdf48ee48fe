"""Start values of space lines by intersection of two planes: appendix C.3, for many lines at a time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.geometry.rotation import cross
from photogrammetry.intersection.image_line import ImageLines
from rig.arrays import Flags, Floats
from rig.errors import BadInputError

_COINCIDENT = 1e-12  # rad; planes with a smaller angle between them coincide to working precision
_COINCIDENT_SIGMAS = 3.0  # standard deviations of that angle; below it planes coincide within their accuracy
_ACROSS = 0.01  # X component of a unit direction below which C8 cannot represent the line


@dataclass(frozen=True, slots=True)
class LineStart:
    """Start values of n lines in m images, each in a system with its own origin on the line.

    Attributes:
        parameters: (n, 4) alpha, beta, gamma, delta relative to the origins.
        origins: (n, 3) points on the lines, where the first image saw them.
        centres: (n, m, 3) projection centres relative to the origins.
        distance: (n,) from the nearest projection centre to the origin.
        images: (n,) number of images in which the line was measured.
        coincident: (n,) whether all planes of a line coincide within their accuracy.
        across: (n,) whether the line runs across the X axis.
    """

    parameters: Floats
    origins: Floats
    centres: Floats
    distance: Floats
    images: NDArray[np.int_]
    coincident: Flags
    across: Flags


def start_lines(cameras: Sequence[IdealCamera], lines: ImageLines) -> LineStart:
    """Intersect the two planes that represent all planes of a line best (C.3).

    The planes are the rows of A; the two right singular vectors with the largest singular values are the best planes
    (the other two span the points of the line); the cross product of their normals is the direction (1, beta, alpha).

    Args:
        cameras: the m cameras.
        lines: (n, m) image lines.

    Returns:
        Start values; finite dummies with the flag set where the planes coincide or the line runs across X.

    Raises:
        BadInputError: the number of cameras is not that of the images.
    """
    if lines.a.ndim != 2 or lines.a.shape[1] != len(cameras):
        raise BadInputError(f"image lines have shape {lines.a.shape}: give (lines, {len(cameras)} images)")
    centres = np.array([camera.X0 for camera in cameras])
    centroid = centres.mean(axis=0)
    spread = float(np.linalg.norm(centres - centroid, axis=1).max()) or 1.0
    planes = _planes(cameras, lines, (centres - centroid) / spread)
    best = np.linalg.svd(planes)[2][:, :2]
    normals = best[:, :, :3] / np.linalg.norm(best[:, :, :3], axis=2, keepdims=True)
    offsets = best[:, :, 3] / np.linalg.norm(best[:, :, :3], axis=2)
    direction = cross(normals[:, 0], normals[:, 1])
    coincident = _coincident(planes, lines) | ~(np.linalg.norm(direction, axis=1) > _COINCIDENT)
    direction[coincident] = (1.0, 0.0, 0.0)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    across = np.abs(direction[:, 0]) < _ACROSS
    foot = np.linalg.pinv(normals) @ -offsets[:, :, None]
    origins = _seen_points(cameras, lines, foot[:, :, 0] * spread + centroid, direction)
    relative = centres - origins[:, None]
    parameters = np.zeros((len(origins), 4))
    parameters[:, :2] = np.where(
        across[:, None], 0.0, direction[:, :0:-1] / np.where(across, 1.0, direction[:, 0])[:, None]
    )
    distance = np.linalg.norm(relative, axis=2).min(axis=1)
    return LineStart(parameters, origins, relative, distance, lines.present.sum(axis=1), coincident, across)


def _planes(cameras: Sequence[IdealCamera], lines: ImageLines, centres: Floats) -> Floats:
    """Rows (n, m, 4) P^T g with unit normals; zero where there is no line."""
    scale = np.array([(-camera.c, -camera.c, 1.0) for camera in cameras])
    rotations = np.array([camera.R for camera in cameras])
    normals = np.einsum("mij,nmj->nmi", rotations, np.nan_to_num(lines.homogeneous()) * scale)
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    normals = normals / np.where(length > 0, length, 1.0)
    planes = np.concatenate((normals, -np.einsum("nmi,mi->nm", normals, centres)[..., None]), axis=2)
    return np.asarray(planes / np.where(length > 0, np.linalg.norm(planes, axis=2, keepdims=True), 1.0))


def _coincident(planes: Floats, lines: ImageLines) -> Flags:
    """Whether the planes' normals differ by no more than the directions of the image lines are uncertain.

    The second eigenvalue of the sum of N N^T is the square sum of the normals' angles from their mean.
    """
    normals = planes[:, :, :3]
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    normals = normals / np.where(length > 0, length, 1.0)
    square_sum = np.linalg.eigvalsh(normals.transpose(0, 2, 1) @ normals)[:, 1]
    variance = np.where(lines.present, lines.covariance[..., 0, 0] / (1 + lines.a**2) ** 2, 0.0).sum(axis=1)
    images = np.maximum(lines.present.sum(axis=1), 2)
    expected = variance * (images - 1) / images
    return np.asarray(square_sum < np.maximum(_COINCIDENT_SIGMAS**2 * expected, _COINCIDENT**2))


def _seen_points(cameras: Sequence[IdealCamera], lines: ImageLines, point: Floats, direction: Floats) -> Floats:
    """Points on the lines next to the ray through the middle of the first image line."""
    first = lines.present.argmax(axis=1)
    each = np.arange(len(first))
    centres = np.array([camera.X0 for camera in cameras])[first]
    middle = np.nan_to_num(lines.centre)
    rays = np.stack([camera.rays(middle[:, i]) for i, camera in enumerate(cameras)], axis=1)[each, first]
    across = cross(direction, rays)
    square = np.maximum((across**2).sum(axis=1), np.finfo(float).tiny)
    along = np.einsum("ni,ni->n", cross(centres - point, rays), across) / square
    # a ray parallel to the line has no nearest point: stay near the cameras then
    return np.asarray(point + np.where(square > 1e-12, along, 0.0)[:, None] * direction)
