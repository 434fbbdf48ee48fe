"""Step 3 of many samples at a time: each with its own orientations and its own errors of the rays.

The normal matrices are those of the error-free flight, the gradients are exact at every step: each point and line ends
at its own least-squares solution of C3, as `step_three` finds it one flight at a time.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from photogrammetry.adjustment.state import State
from photogrammetry.camera_model import Lens, camera_coordinates, ideal_point, undistort
from photogrammetry.diagnosis import NotConvergedError
from photogrammetry.network import Network
from photogrammetry.planning.step_three import Intersected, Sights, line_angles

Floats = NDArray[np.float64]

_STEPS = 30
_ENOUGH = 1e-3  # of a sigma


def intersect_samples(network: Network, states: State, sights: Sights, start: Intersected) -> tuple[Floats, Floats]:
    """Intersect the flights of n samples.

    Args:
        network: says which camera took which image.
        states: orientations, arrays that begin with the sample.
        sights: image coordinates that begin with the sample; who sees what is common to all.
        start: the error-free flight.

    Returns:
        Points (n, t p, 3) and angles (n, t s, 2).

    Raises:
        NotConvergedError: the errors are too large for this flight.
    """
    camera = [image.camera for image in network.images]
    interior = states.interior[:, None, camera]
    pose = states.rotation[:, None], states.position[:, None]
    xy = _reduced(interior, sights.points)

    def point_gradient(points: Floats) -> Floats:
        return _point_gradient(interior[..., 0], *pose, points, xy, sights.points_seen)

    points = _iterate(np.repeat(start.points[None], len(xy), axis=0), start.points_covariance, point_gradient, sights)
    if not sights.skis.size:
        return points, np.zeros((len(xy), 0, 2))
    ski_xy = _reduced(interior[..., None, :], sights.skis)

    def line_gradient(lines: Floats) -> Floats:
        return _line_gradient(interior[..., 0], *pose, lines, ski_xy, sights.skis_seen)

    lines = _iterate(np.repeat(start.lines[None], len(xy), axis=0), start.lines_covariance, line_gradient, sights)
    return points, line_angles(lines[..., 0], lines[..., 1])


def _iterate(values: Floats, covariance: Floats, gradient: Callable[[Floats], Floats], sights: Sights) -> Floats:
    """Values (n, items, u) where the gradient vanishes; covariance (items, u, u)."""
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    cofactors = covariance / sights.sigma**2
    for _ in range(_STEPS):
        step = np.einsum("iuv,niv->niu", cofactors, gradient(values))
        values = values - step
        if np.abs(step / sigma).max() < _ENOUGH:
            return values
    raise NotConvergedError("a simulated intersection does not settle; the errors are too large for this network")


def _reduced(interior: Floats, xy: Floats) -> Floats:
    if not interior[..., 1:].any():
        return xy
    return undistort(Lens(interior, np.asarray(0.0), np.asarray(False)), xy)


def _point_gradient(
    c: Floats, rotation: Floats, position: Floats, points: Floats, xy: Floats, seen: NDArray[np.bool_]
) -> Floats:
    """Half the gradient of C3 by points (n, i, 3)."""
    k = camera_coordinates(rotation, position, points[:, :, None])
    ideal = ideal_point(c, k)
    wrong = np.where(seen[..., None], ideal - xy, 0.0)
    by_k = np.concatenate((c[..., None] * wrong, np.sum(ideal * wrong, axis=-1, keepdims=True)), axis=-1) / -k[..., 2:]
    gradient: Floats = np.einsum("nmij,npmj->npi", rotation[:, 0], by_k, optimize=True)
    return gradient


def _line_gradient(
    c: Floats, rotation: Floats, position: Floats, lines: Floats, xy: Floats, seen: NDArray[np.bool_]
) -> Floats:
    """Half the gradient of C3 by alpha, beta, gamma, delta (n, i, 4).

    In the camera system the plane through line and projection centre has the normal f = a x d (a: the line's point at
    X = 0, d: its direction); an image point lies |f1 x + f2 y - c f3| / |(f1, f2)| from the projected line.
    """
    alpha, beta, gamma, delta = np.moveaxis(lines[:, :, None], -1, 0)
    zero, one = np.zeros_like(alpha), np.ones_like(alpha)
    a = camera_coordinates(rotation, position, np.stack((zero, delta, gamma), axis=-1))
    d = camera_coordinates(rotation, np.zeros(3), np.stack((one, beta, alpha), axis=-1))
    f = np.cross(a, d)
    root = np.hypot(f[..., 0], f[..., 1])[..., None]
    x, y = xy[..., 0], xy[..., 1]
    distance = (f[..., :1] * x + f[..., 1:2] * y - (c * f[..., 2])[..., None]) / root
    distance = np.where(seen, distance, 0.0)
    weighted, square = distance / root, np.sum((distance / root) ** 2, axis=-1)
    by_f = np.stack(
        (
            np.sum(weighted * x, axis=-1) - square * f[..., 0],
            np.sum(weighted * y, axis=-1) - square * f[..., 1],
            -c * np.sum(weighted, axis=-1),
        ),
        axis=-1,
    )
    by_direction, by_place = (
        np.einsum("nmij,nlmj->nli", rotation[:, 0], np.cross(*pair), optimize=True) for pair in ((by_f, a), (d, by_f))
    )
    return np.stack((by_direction[..., 2], by_direction[..., 1], by_place[..., 2], by_place[..., 1]), axis=-1)
