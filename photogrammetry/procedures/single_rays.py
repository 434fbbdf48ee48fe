"""Surveyed points that one image shows, and that do not lie on their ray.

Nothing tells whether survey or image point is wrong, and the free block lacks such a point. With an error of metres it
would bend the whole adjustment, so both observations are left out, and both are named.
"""

import numpy as np

from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.gross_errors.blunders import Blunder, BlunderKind, Observation, Removed
from photogrammetry.adjustment.solution.global_test import ABSURD
from photogrammetry.geometry.camera_model import camera_coordinates, image_point
from photogrammetry.network.model import Network
from photogrammetry.network.selection import rays, with_interior
from photogrammetry.procedures.findings import SURVEYED


def contradicted_rays(network: Network, state: State) -> list[Removed]:
    """Points with survey and a single ray that contradict each other beyond doubt.

    The limit leaves room for the uncertainty of the pose, which the sigmas of survey and ray do not contain. Smaller
    errors are left to the tests of the adjustment.

    Args:
        network: with poses and points as in `state`.
        state: poses from the images and the other points.
    """
    counts, o = rays(network), network.observations
    cameras = with_interior(network, state.interior).cameras
    found = []
    for index, point in enumerate(network.points):
        if counts[index] != 1 or point.role not in SURVEYED or point.xyz is None:
            continue
        row = int(np.flatnonzero(o.point == index)[0])
        image = int(o.image[row])
        camera = cameras[network.images[image].camera]
        pose = state.rotation[image], state.position[image]
        depth = abs(float(camera_coordinates(*pose, point.xyz)[2]))
        survey = np.zeros(3) if point.sigma is None else point.sigma
        sigma = float(np.hypot(np.linalg.norm(o.sigma[row]), camera.interior[0] / depth * np.linalg.norm(survey)))
        size = float(np.linalg.norm(o.xy[row] - image_point(camera.lens(), *pose, point.xyz))) / sigma
        if size > ABSURD:
            itself, ray = Observation(BlunderKind.CONTROL, index), Observation(BlunderKind.IMAGE, row)
            found.append(Removed(Blunder(itself, np.zeros(0), size, False, (itself, ray)), network))
    return found
