"""Principal distances from control: appendix B for planar control, the direct linear transformation otherwise.

Both are closed, so that a c wrong by a factor of two does no harm. The residuals of the resections decide between them
and the given value.
"""

from contextlib import suppress

import numpy as np

from photogrammetry.ideal_camera import Array
from photogrammetry.network import Network
from photogrammetry.start_values.dlt import resect_dlt
from photogrammetry.start_values.homography import plane_homography
from photogrammetry.start_values.image_block import ImageBlock
from photogrammetry.start_values.resection import resect
from photogrammetry.start_values.vanishing_points import principal_distance_from
from rig.errors import BadInputError

_CONTROL_IMAGES = 8
_PLANAR = 1e-3  # thickness over extent


def open_cameras(network: Network, block: ImageBlock) -> list[int]:
    """Cameras whose c is unknown and not observed, and which have images without a pose: their c may be far off."""
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
