"""Step 3 of a planned flight: jumper points by C.1, ski directions by C15, and what the stick model takes from them.

`intersect_flight` intersects one flight with the orientations of one adjustment. `intersect_samples` does it for many
samples at a time, each with its own orientations and its own errors of the rays. It takes the normal matrices of the
error-free flight and exact gradients, so each point and line ends at its own least-squares solution of C3.

The features of one position are its points (3 p numbers), then slope and heading of its skis (2 s numbers).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.geometry.camera_model import Lens, camera_coordinates, ideal_point, undistort
from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.geometry.rotation import cross
from photogrammetry.intersection.line_intersection import intersect_lines_in_one_step
from photogrammetry.intersection.point_intersection import intersect_points
from photogrammetry.jumper.stick_model import body_angles, direction_of
from photogrammetry.network.diagnosis import NotConvergedError
from photogrammetry.network.model import Network
from photogrammetry.planning.plan import Flight, Plan, Stick
from photogrammetry.planning.sight import in_sight
from rig.arrays import Flags, Floats

_MOST_STEPS = 30
_SETTLED_SIGMAS = 1e-3  # of a sigma
_DIFFERENCE = 1e-6  # rad and object unit, of central differences; rounding and curvature leave an error of 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Sights:
    """Image coordinates of a flight in m images, and which exist.

    Attributes:
        points: (t p, m, 2).
        points_seen: (t p, m).
        skis: (t s, m, k, 2).
        skis_seen: (t s, m, k).
        sigma: of an image coordinate.
    """

    points: Floats
    points_seen: Flags
    skis: Floats
    skis_seen: Flags
    sigma: float


@dataclass(frozen=True, slots=True, eq=False)
class Intersected:
    """Points (t p, 3), lines (t s, 4), angles (t s, 2) slope and heading (rad); covariances from the rays alone."""

    points: Floats
    points_covariance: Floats
    lines: Floats
    lines_covariance: Floats
    angles: Floats
    angles_covariance: Floats


def error_free_sights(plan: Plan, flight: Flight) -> Sights:
    """Image coordinates of the flight without errors."""
    network = plan.network

    def sighted(xyz: Floats) -> tuple[Floats, Flags]:
        both = [in_sight(plan.obstacles, network.cameras[image.camera], image, xyz) for image in network.images]
        return np.stack([xy for xy, _ in both], axis=1), np.stack([seen for _, seen in both], axis=1)

    points, points_seen = sighted(flight.points.reshape(-1, 3))
    skis, whole = sighted(flight.skis.reshape(-1, *flight.skis.shape[2:]))
    return Sights(points, points_seen, skis, whole, plan.sigma)


def intersect_flight(network: Network, state: State, sights: Sights) -> Intersected:
    """Intersect all points and skis; the orientations of `state` are constants."""
    interior = state.interior[[image.camera for image in network.images]]
    cameras = [
        IdealCamera(float(c), position, rotation)
        for c, position, rotation in zip(interior[:, 0], state.position, state.rotation, strict=True)
    ]
    points = intersect_points(cameras, _reduced(interior, sights.points), seen=sights.points_seen, sigma=sights.sigma)
    if not sights.skis.size:
        none = (np.zeros((0, 4)), np.zeros((0, 4, 4)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
        return Intersected(points.X, points.covariance, *none)
    ski_xy = _reduced(interior[:, None], sights.skis)
    lines = intersect_lines_in_one_step(cameras, ski_xy, sights.sigma, seen=sights.skis_seen)
    slopes = _slopes(lines.parameters)
    covariance = slopes @ lines.covariance[:, :2, :2] @ slopes.transpose(0, 2, 1)
    angles = line_angles(lines.parameters[:, 0], lines.parameters[:, 1])
    return Intersected(points.X, points.covariance, lines.parameters, lines.covariance, angles, covariance)


def line_angles(alpha: Floats, beta: Floats) -> Floats:
    """Slope and heading (..., 2), rad, of directions (1, beta, alpha)."""
    return np.stack((np.arctan(alpha / np.hypot(1.0, beta)), np.arctan(beta)), axis=-1)


def _slopes(parameters: Floats) -> Floats:
    """Derivatives of slope and heading by alpha, beta (n, 2, 2)."""
    alpha, beta = parameters[:, 0], parameters[:, 1]
    level = 1.0 + beta**2
    slopes = np.zeros((len(alpha), 2, 2))
    slopes[:, 0, 0] = np.sqrt(level) / (level + alpha**2)
    slopes[:, 0, 1] = -alpha * beta / (np.sqrt(level) * (level + alpha**2))
    slopes[:, 1, 1] = 1.0 / level
    return slopes


def intersect_samples(network: Network, states: State, sights: Sights, start: Intersected) -> tuple[Floats, Floats]:
    """Intersect the flights of n samples.

    Args:
        network: says which camera took which image.
        states: orientations, arrays that begin with the sample.
        sights: image coordinates, arrays that begin with the sample; which exist is common to all samples.
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

    points = _settled(np.repeat(start.points[None], len(xy), axis=0), start.points_covariance, point_gradient, sights)
    if not sights.skis.size:
        return points, np.zeros((len(xy), 0, 2))
    ski_xy = _reduced(interior[..., None, :], sights.skis)

    def line_gradient(lines: Floats) -> Floats:
        return _line_gradient(interior[..., 0], *pose, lines, ski_xy, sights.skis_seen)

    lines = _settled(np.repeat(start.lines[None], len(xy), axis=0), start.lines_covariance, line_gradient, sights)
    return points, line_angles(lines[..., 0], lines[..., 1])


def _settled(values: Floats, covariance: Floats, gradient: Callable[[Floats], Floats], sights: Sights) -> Floats:
    """Values (n, items, u) where the gradient vanishes; covariance (items, u, u)."""
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    cofactors = covariance / sights.sigma**2
    for _ in range(_MOST_STEPS):
        step = np.einsum("iuv,niv->niu", cofactors, gradient(values))
        values = values - step
        if np.abs(step / sigma).max() < _SETTLED_SIGMAS:
            return values
    raise NotConvergedError("a simulated intersection does not settle; the errors are too large for this network")


def _reduced(interior: Floats, xy: Floats) -> Floats:
    """Ideal image coordinates (..., 2) with interior orientations (..., 10), which broadcast."""
    if not interior[..., 1:].any():
        return xy
    return undistort(Lens(interior, np.asarray(0.0), np.asarray(False)), xy)


def _point_gradient(c: Floats, rotation: Floats, position: Floats, points: Floats, xy: Floats, seen: Flags) -> Floats:
    """Half the gradient of C3 by points (n, i, 3)."""
    k = camera_coordinates(rotation, position, points[:, :, None])
    ideal = ideal_point(c, k)
    wrong = np.where(seen[..., None], ideal - xy, 0.0)
    by_k = np.concatenate((c[..., None] * wrong, np.sum(ideal * wrong, axis=-1, keepdims=True)), axis=-1) / -k[..., 2:]
    gradient: Floats = np.einsum("nmij,npmj->npi", rotation[:, 0], by_k, optimize=True)
    return gradient


def _line_gradient(c: Floats, rotation: Floats, position: Floats, lines: Floats, xy: Floats, seen: Flags) -> Floats:
    """Half the gradient of C3 by alpha, beta, gamma, delta (n, i, 4).

    In the camera system the plane through line and projection centre has the normal f = a x d (a: the line's point at
    X = 0, d: its direction); an image point lies |f1 x + f2 y - c f3| / |(f1, f2)| from the projected line.
    """
    alpha, beta, gamma, delta = np.moveaxis(lines[:, :, None], -1, 0)
    zero, one = np.zeros_like(alpha), np.ones_like(alpha)
    a = camera_coordinates(rotation, position, np.stack((zero, delta, gamma), axis=-1))
    d = camera_coordinates(rotation, np.zeros(3), np.stack((one, beta, alpha), axis=-1))
    f = cross(a, d)
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
        np.einsum("nmij,nlmj->nli", rotation[:, 0], cross(*pair), optimize=True) for pair in ((by_f, a), (d, by_f))
    )
    return np.stack((by_direction[..., 2], by_direction[..., 1], by_place[..., 2], by_place[..., 1]), axis=-1)


def features(points: Floats, angles: Floats) -> Floats:
    """Features (..., 3 p + 2 s) of points (..., p, 3) and ski angles (..., s, 2)."""
    flat = (*points.shape[:-2], -1)
    return np.concatenate([points.reshape(flat), angles.reshape(flat)], axis=-1)


def stick_values(flight: Flight, stick: Stick, of: Floats) -> Floats:
    """Alpha, beta, gamma, dphi, phi (rad) and the height of O of features (..., f): (..., 6)."""
    split = 3 * len(flight.names)
    points = of[..., :split].reshape(*of.shape[:-1], -1, 3)
    skis = direction_of(of[..., split:].reshape(*of.shape[:-1], -1, 2))
    origin = points[..., stick.bindings, :].mean(axis=-2)
    right, left = (skis[..., ski, :] for ski in stick.skis)
    angles = body_angles(points[..., stick.helmet, :], points[..., stick.hip, :], origin, right, left)
    return np.concatenate([angles, origin[..., 2:]], axis=-1)


def stick_slopes(flight: Flight, stick: Stick, of: Floats) -> Floats:
    """Derivatives (t, 6, f) of `stick_values` by the features (t, f): central differences."""
    steps = _DIFFERENCE * np.eye(of.shape[-1])[:, None]
    change = stick_values(flight, stick, of + steps) - stick_values(flight, stick, of - steps)
    return np.moveaxis(change / (2.0 * _DIFFERENCE), 0, -1)


def origin_weights(stick: Stick, count: int) -> Floats:
    """O as a linear function of the `count` features of its position: (3, f)."""
    weights = np.zeros((3, count))
    for binding in stick.bindings:
        weights[:, 3 * binding : 3 * binding + 3] += 0.5 * np.eye(3)
    return weights


def speeds(stick: Stick, origins: Floats) -> Floats:
    """Speed of O (..., t - 1), object unit per second, from one pulse to the next: origins (..., t, 3)."""
    speed: Floats = stick.rate_hz * np.linalg.norm(np.diff(origins, axis=-2), axis=-1)
    return speed
