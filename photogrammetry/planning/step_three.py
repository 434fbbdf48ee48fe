"""Step 3 at given orientations: jumper points by C.1, ski directions by C15."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from photogrammetry.adjustment.state import State
from photogrammetry.camera_model import Lens, undistort
from photogrammetry.ideal_camera import IdealCamera
from photogrammetry.intersection.line_intersection import intersect_lines_in_one_step
from photogrammetry.intersection.point_intersection import intersect_points
from photogrammetry.network import Network
from photogrammetry.planning.plan import Flight, Plan, in_picture

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Sights:
    """Image coordinates of a flight, and who sees what; m images.

    Attributes:
        points: (t p, m, 2).
        points_seen: (t p, m).
        skis: (t s, m, k, 2).
        skis_seen: (t s, m, k).
        sigma: of an image coordinate.
    """

    points: Floats
    points_seen: NDArray[np.bool_]
    skis: Floats
    skis_seen: NDArray[np.bool_]
    sigma: float


@dataclass(frozen=True, slots=True, eq=False)
class Intersected:
    """Points (t p, 3), lines (t s, 4), angles (t s, 2) slope and heading (rad); covariance of the rays alone."""

    points: Floats
    points_covariance: Floats
    lines: Floats
    lines_covariance: Floats
    angles: Floats
    angles_covariance: Floats


def error_free_sights(plan: Plan, flight: Flight) -> Sights:
    """What the images will show of the flight."""
    network = plan.network

    def sighted(xyz: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        both = [in_picture(network.cameras[image.camera], image, xyz) for image in network.images]
        return np.stack([xy for xy, _ in both], axis=1), np.stack([seen for _, seen in both], axis=1)

    points, points_seen = sighted(flight.points.reshape(-1, 3))
    skis, whole = sighted(flight.skis.reshape(-1, *flight.skis.shape[2:]))
    return Sights(points, points_seen, skis, whole, plan.sigma)


def intersect_flight(network: Network, state: State, sights: Sights) -> Intersected:
    """Intersect everything with the orientations of `state` as error-free."""
    cameras, lenses = [], []
    for i, image in enumerate(network.images):
        interior = state.interior[image.camera]
        cameras.append(IdealCamera(float(interior[0]), state.position[i], state.rotation[i]))
        lenses.append(Lens(interior, np.asarray(0.0), np.asarray(False)))
    points = intersect_points(cameras, _reduced(lenses, sights.points), seen=sights.points_seen, sigma=sights.sigma)
    if not sights.skis.size:
        none = (np.zeros((0, 4)), np.zeros((0, 4, 4)), np.zeros((0, 2)), np.zeros((0, 2, 2)))
        return Intersected(points.X, points.covariance, *none)
    lines = intersect_lines_in_one_step(cameras, _reduced(lenses, sights.skis), sights.sigma, seen=sights.skis_seen)
    slopes = _slopes(lines.parameters)
    covariance = slopes @ lines.covariance[:, :2, :2] @ slopes.transpose(0, 2, 1)
    angles = line_angles(lines.parameters[:, 0], lines.parameters[:, 1])
    return Intersected(points.X, points.covariance, lines.parameters, lines.covariance, angles, covariance)


def _reduced(lenses: list[Lens], xy: Floats) -> Floats:
    """Ideal coordinates; image by image along axis 1."""
    out = np.empty_like(xy)
    for i, lens in enumerate(lenses):
        if lens.interior[1:].any():
            out[:, i] = undistort(lens, xy[:, i])
        else:
            out[:, i] = xy[:, i]
    return out


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
