"""Finds principal distances that are unknown and whose given values may be wrong by a factor of two.

With control points the solution is closed: from vanishing points (appendix B) where the control of an image is planar,
by direct linear transformation otherwise. The residuals of the resections decide between these and the given value.
Without control a trial adjustment of what a block has of its network estimates them.

Appendix B: the constraint u^T K^-T K^-1 v = 0 (B1) of the vanishing points u, v of two directions at right angles gives
c^2 = -(u1 v1 + u2 v2) / (u3 v3); the paper's last equation prints it without the minus sign. Image coordinates are
reduced to the principal point, in the metric frame.
"""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.solution.adjustment import adjust_once
from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.network.model import Camera, Datum, DatumType, Network, Reweight, Role
from photogrammetry.network.selection import sub_network
from photogrammetry.start_values.image_block import ImageBlock
from photogrammetry.start_values.projective import plane_homography, resect_dlt
from photogrammetry.start_values.resection import resect
from rig.arrays import Flags, Floats, Integers
from rig.errors import BadInputError

_CONTROL_IMAGES = 8
_PLANAR = 1e-3  # thickness over extent
_UNDETERMINED = 1e-6  # least 1 / c: vanishing points that give less do not determine c
_MIN_RAYS = 2


def open_cameras(network: Network, block: ImageBlock) -> list[int]:
    """Cameras whose c may be far off: it is unknown and not observed, and some of their images have no pose."""
    without = {int(block.sightings.camera[i]) for i in range(block.sightings.n_images) if i not in block.cameras}
    cameras = network.cameras
    return [i for i in sorted(without) if "c" in cameras[i].estimate and "c" not in cameras[i].sigma]


def from_control(block: ImageBlock, camera: int) -> float | None:
    """Principal distance of one camera from the control points in its images.

    Args:
        block: sightings and held points.
        camera: index of the camera.

    Returns:
        The closed solution or the given value, whichever fits better; None without enough control.
    """
    sightings = block.sightings
    views = []
    for image in np.flatnonzero(sightings.camera == camera):
        held = block.held[sightings.points[image]]
        if held.sum() >= 4:
            views.append((block.xyz[sightings.points[image][held]], sightings.xy[image][held]))
    views.sort(key=lambda view: -len(view[0]))
    candidates = _closed_solutions(views)
    if not candidates:
        return None

    def misfit(c: float) -> float:
        return float(np.median([_resection_residual(points, xy, c) for points, xy in views[:_CONTROL_IMAGES]]))

    return min((float(sightings.c[camera]), *candidates), key=misfit)


def _closed_solutions(views: list[tuple[Floats, Floats]]) -> list[float]:
    homographies, direct = [], []
    for points, xy in views:
        centred = points - points.mean(axis=0)
        _, extents, axes = np.linalg.svd(centred, full_matrices=False)
        try:
            if extents[2] < _PLANAR * extents[0]:
                homographies.append(plane_homography(centred @ axes[:2].T, xy))
            elif len(points) >= 6:
                direct.append(resect_dlt(points, xy).camera.c)
        except BadInputError:
            continue  # points on a line: this image does not determine c
    found = [float(np.median(direct))] if direct else []
    if homographies:
        with suppress(BadInputError):  # nor do frontal images
            found.append(principal_distance(pair for matrix in homographies for pair in plane_directions(matrix)))
    return found


def _resection_residual(points: Floats, xy: Floats, c: float) -> float:
    try:
        return float(np.sqrt((resect(points, xy, c).residuals ** 2).mean()))
    except BadInputError:
        return float(np.inf)


def principal_distance(pairs: Iterable[tuple[Floats, Floats]]) -> float:
    """Principal distance from all that one camera has seen, by least squares in 1 / c^2.

    Args:
        pairs: homogeneous vanishing points (3,) of two directions at right angles, any number of pairs.

    Returns:
        c, image unit.

    Raises:
        BadInputError: no pair determines c (the camera's axis is at right angles to one of its directions), or the
            pairs contradict a pinhole.
    """
    p, q = np.array([_constraint(u, v) for u, v in pairs]).reshape(-1, 2).T
    if not p @ p > 0 or not q @ q > 0:
        raise BadInputError("no vanishing point determines the principal distance: take an oblique image")
    inverse_square = -(p @ q) / (p @ p)
    if not inverse_square > _UNDETERMINED**2:
        raise BadInputError("the vanishing points fit no principal distance: check the lines, or take an oblique image")
    return float(1 / np.sqrt(inverse_square))


def plane_directions(homography: Floats) -> list[tuple[Floats, Floats]]:
    """Vanishing points of the axes of a plane, and of the diagonals between them: two pairs at right angles.

    Args:
        homography: H (3, 3) of a plane whose two axes have equal scale; its first two columns are the vanishing points.
    """
    s, t, _ = homography.T
    return [(s, t), (s + t, s - t)]


def _constraint(u: Floats, v: Floats) -> tuple[float, float]:
    """The constraint p / c^2 + q = 0 of a pair, scaled by the lengths of both points in the image."""
    size = float(np.hypot(*u[:2]) * np.hypot(*v[:2])) or 1.0
    return float(u[:2] @ v[:2]) / size, float(u[2] * v[2]) / size


def adjust_block(network: Network, block: ImageBlock) -> tuple[ImageBlock, float] | None:
    """Adjust the oriented images and the points with two rays or more.

    Args:
        network: the whole network.
        block: poses and coordinates as start values; not changed.

    Returns:
        The adjusted block, in the network's datum or free if that does not hold it, and its estimated over its a-priori
        sigma0; None if no optimum was reached.
    """
    images, points = _determined(block)
    part = _part(network, block, images, points)
    for candidate in (part, _free(part)):
        try:
            adjusted = adjust_once(candidate)
            return _with_values(block, adjusted.state, images, points), adjusted.ratio
        except NotSolvableError:
            continue  # the free network may be solvable
        except NotConvergedError:
            return None
    return None


def _determined(block: ImageBlock) -> tuple[list[int], Integers]:
    """Oriented images, and points with enough rays that lie in front of all images that show them."""
    images = sorted(block.cameras)
    rays = block.sightings.seen()[images].sum(axis=0)
    good = block.known & ((rays >= _MIN_RAYS) | (block.held & (rays > 0)))
    for image, camera in block.cameras.items():
        shown = block.sightings.points[image]
        good[shown] &= camera.in_front(block.xyz[shown])
    return images, np.flatnonzero(good)


def _part(network: Network, block: ImageBlock, images: list[int], points: Integers) -> Network:
    """The network of these images and points alone, with the block's values; indices change."""
    part = sub_network(network, _mask(images, len(network.images)), _mask(points, len(network.points)))
    oriented = tuple(
        replace(network.images[i], position=block.cameras[i].X0, rotation=block.cameras[i].R) for i in images
    )
    known = tuple(
        network.points[i] if block.held[i] else replace(network.points[i], role=Role.TIE, xyz=block.xyz[i])
        for i in points
    )
    cameras = _cameras(network, block, images)
    return replace(part, cameras=cameras, images=oriented, points=known, reweight=Reweight.NONE)


def _mask(chosen: Sequence[int] | Integers, count: int) -> Flags:
    out = np.zeros(count, dtype=bool)
    out[chosen] = True
    return out


def _cameras(network: Network, block: ImageBlock, images: list[int]) -> tuple[Camera, ...]:
    """The cameras with the block's principal distances; those without an image keep all their parameters."""
    used = set(block.sightings.camera[images].tolist())
    return tuple(
        replace(
            camera,
            interior=np.array([block.sightings.c[i], *camera.interior[1:]]),
            estimate=camera.estimate if i in used else (),
        )
        for i, camera in enumerate(network.cameras)
    )


def _free(part: Network) -> Network:
    """The same network by the images alone: no control, no distances, inner constraints."""
    points = tuple(replace(point, role=Role.TIE, sigma=None) for point in part.points)
    return replace(part, points=points, distances=(), differences=(), datum=Datum(DatumType.INNER))


def _with_values(block: ImageBlock, state: State, images: list[int], points: Integers) -> ImageBlock:
    """A copy of the block with adjusted principal distances, poses and points; what is given stays."""
    found = block.with_c(state.interior[:, 0])
    for image, position, rotation in zip(images, state.position, state.rotation, strict=True):
        if image not in found.settled:
            found.cameras[image] = IdealCamera(found.sightings.c_of(image), position, rotation)
    loose = ~found.held[points]
    found.xyz[points[loose]] = state.xyz[loose]
    return found
