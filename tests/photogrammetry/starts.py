"""Start values of points from given poses: where their rays come nearest to each other."""

from dataclasses import replace

import numpy as np

from photogrammetry.network import Network


def intersected(network: Network) -> Network:
    """The network with coordinates for all points that have none."""
    observed, points = network.observations, list(network.points)
    for i, point in enumerate(points):
        if point.xyz is not None:
            continue
        normal, right = np.zeros((3, 3)), np.zeros(3)
        for row in np.flatnonzero(observed.point == i):
            image = network.images[observed.image[row]]
            assert image.rotation is not None
            assert image.position is not None
            c = network.cameras[image.camera].interior[0]
            ray = image.rotation @ np.append(observed.xy[row], -c)
            across = np.eye(3) - np.outer(ray, ray) / (ray @ ray)
            normal += across
            right += across @ image.position
        points[i] = replace(point, xyz=np.asarray(np.linalg.solve(normal, right), dtype=float))
    return replace(network, points=tuple(points))
