"""Principal distances that may be wrong by a factor of two, put right before the adjustment.

With control in an image, appendix B (planar control) or the direct linear transformation gives c in closed form, and
the residuals of the resections decide. Without, the images themselves must: a small block of them fits together best
with the right c. The square sum of its residuals is nearly a parabola in log c, with one minimum, so that a few trial
blocks find it. Images of one camera from three directions suffice; cameras with fewer images are searched together.
"""

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from photogrammetry.block_seed import seed_block
from photogrammetry.dlt import resect_dlt
from photogrammetry.homography import plane_homography
from photogrammetry.ideal_camera import Array
from photogrammetry.image_block import ImageBlock
from photogrammetry.network import Network
from photogrammetry.resection import resect
from photogrammetry.sightings import Sightings
from photogrammetry.vanishing_points import principal_distance_from
from rig.errors import BadInputError

_OWN_IMAGES = 3  # with so many, a camera is searched by its own images
_TRIAL_IMAGES = 6
_CONTROL_IMAGES = 8
_STEP = 0.4  # octaves
_FINE_STEP = 0.12
_FARTHEST = 1.8  # octaves
_PLANAR = 1e-3  # thickness over extent

Misfit = Callable[[float], float]


def improve_principal_distances(network: Network, block: ImageBlock) -> Array:
    """Principal distances of those cameras whose c is unknown and not observed, where poses are missing.

    Args:
        network: `estimate` and `sigma` of its cameras say which c may be changed.
        block: what is known at the beginning: sightings, control, given poses.

    Returns:
        (cameras,) principal distances; the given ones where they may not or need not be changed.
    """
    sightings = block.sightings
    c = sightings.c.copy()
    open_cameras = []
    for index, camera in enumerate(network.cameras):
        without = set(np.flatnonzero(sightings.camera == index).tolist()) - set(block.cameras)
        if "c" in camera.estimate and "c" not in camera.sigma and without:
            open_cameras.append(index)
    for index in list(open_cameras):
        found = _from_control(block, index)
        if found is not None:
            c[index] = found
            open_cameras.remove(index)
    for index in list(open_cameras):
        images = _best_images(sightings, [index])
        if len(images) >= _OWN_IMAGES:
            c[index] *= _search(_block_misfit(sightings.with_c(c), images, [index]))
            open_cameras.remove(index)
    if open_cameras:
        _search_together(sightings, open_cameras, c)
    return c


def _search_together(sightings: Sightings, cameras: list[int], c: Array) -> None:
    """First a common factor, then each camera's own, with images of all cameras; c is changed in place."""
    images = _best_images(sightings, list(range(len(c))))
    if len(images) < _OWN_IMAGES:
        return
    c[cameras] *= _search(_block_misfit(sightings.with_c(c), images, cameras))
    if len(cameras) > 1:
        for camera in cameras:
            c[camera] *= _search(_block_misfit(sightings.with_c(c), images, [camera]))


def _best_images(sightings: Sightings, cameras: list[int]) -> list[int]:
    """Images of these cameras that share most points with one another."""
    images = np.flatnonzero(np.isin(sightings.camera, cameras))
    seen = sightings.seen()[images].astype(int)
    common = (seen @ seen.T).sum(axis=1)
    order = np.argsort(-common, kind="stable")[:_TRIAL_IMAGES]
    return sorted(int(images[i]) for i in order)


def _block_misfit(sightings: Sightings, images: list[int], cameras: list[int]) -> Misfit:
    """Residual of a block of these images as a function of the common factor of these cameras, in octaves."""
    part = sightings.of_images(images)

    def misfit(octaves: float) -> float:
        c = part.c.copy()
        c[cameras] *= 2.0**octaves
        scaled = part.with_c(c)
        block = seed_block(scaled, list(range(len(images))))
        if block is None:
            return float(np.inf)
        if len(block.cameras) < len(images):
            block.grow()
        return block.residual() * float(np.sqrt(len(images) / len(block.cameras)))

    return misfit


def _search(misfit: Misfit) -> float:
    """Factor at the minimum: walk until it is bracketed, then the vertex of a parabola, coarse and fine."""
    centre, values = 0.0, {x: misfit(x) for x in (-_STEP, 0.0, _STEP)}
    if not np.isfinite(list(values.values())).all():
        return 1.0
    while abs(centre) < _FARTHEST:
        lower, upper = centre - _STEP, centre + _STEP
        for x in (lower, upper):
            values.setdefault(x, misfit(x))
        best = min((lower, centre, upper), key=lambda x: values[x])
        if best == centre:
            break
        centre = best
    centre = _vertex(centre, _STEP, misfit, values)
    return float(2.0 ** _vertex(centre, _FINE_STEP, misfit, {}))


def _vertex(centre: float, step: float, misfit: Misfit, values: dict[float, float]) -> float:
    """Place of the smallest square of the misfit by three points, never farther than one step."""
    left, middle, right = (values.get(x, 0.0) or misfit(x) for x in (centre - step, centre, centre + step))
    curvature = left**2 - 2 * middle**2 + right**2
    if not np.isfinite(curvature) or curvature <= 0:
        return centre
    return centre + step * float(np.clip(0.5 * (left**2 - right**2) / curvature, -1, 1))


def _from_control(block: ImageBlock, camera: int) -> float | None:
    """Closed solutions from control points, judged by the residuals of the resections; None without enough control."""
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


def _closed_solutions(views: list[tuple[Array, Array]]) -> list[float]:
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
            continue  # points on a line: this image says nothing about c
    found = [float(np.median(direct))] if direct else []
    if homographies:
        with suppress(BadInputError):  # frontal images say nothing about c either
            found.append(principal_distance_from([], homographies))
    return found


def _resection_residual(points: Array, xy: Array, c: float) -> float:
    try:
        return float(np.sqrt((resect(points, xy, c).residuals ** 2).mean()))
    except BadInputError:
        return float(np.inf)
