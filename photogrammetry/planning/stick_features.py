"""What the stick model of Fig. 6 takes from step 3: the angles of the body, height and speed of O.

The features of one position are its points (3 p numbers), then slope and heading of its skis (2 s numbers).
"""

import numpy as np
from numpy.typing import NDArray

from photogrammetry.jumper.stick_model import body_angles, direction_of
from photogrammetry.planning.plan import Flight, Stick

Floats = NDArray[np.float64]

_STEP = 1e-6  # rad, object unit: rounding and curvature leave 1e-9


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
    steps = _STEP * np.eye(of.shape[-1])[:, None]
    change = stick_values(flight, stick, of + steps) - stick_values(flight, stick, of - steps)
    return np.moveaxis(change / (2.0 * _STEP), 0, -1)


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
