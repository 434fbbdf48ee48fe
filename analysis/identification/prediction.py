"""What is to be expected at a pulse by what was measured before and after it, not at it: two Kalman filters that meet.

Places of markers and angles of skis move alike: their second derivative changes as a random walk (white jerk). The
strength of the walk is that of a jumper's strongest movements: the prediction is a gate and pulls no measurement.
"""

from dataclasses import dataclass

import numpy as np

from rig.arrays import Flags, Floats


@dataclass(frozen=True, slots=True)
class Mobility:
    """How freely something moves; standard deviations.

    Attributes:
        jerk: spectral density of the third derivative, unit^2/s^5.
        place: before the first measurement.
        velocity: against the mean one, per s.
        acceleration: per s^2.
    """

    jerk: float
    place: float
    velocity: float
    acceleration: float


#: Markers, m: an acceleration that changes by 25 m/s^2 within 0.1 s.
MARKER = Mobility(25.0**2 / 0.1, 100.0, 6.0, 15.0)
#: Slope and heading of a ski, rad: an angular acceleration that changes by 15 rad/s^2 within 0.1 s.
SKI = Mobility(15.0**2 / 0.1, 1.0, 1.0, 10.0)


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Predicted values of n things at t pulses.

    Attributes:
        xyz: (t, n, d) places with d coordinates, or angles.
        covariance: (t, n, d, d).
        velocity: (t, n, d) per s.
    """

    xyz: Floats
    covariance: Floats
    velocity: Floats


def predict(time_s: Floats, xyz: Floats, covariance: Floats, velocity: Floats, mobility: Mobility) -> Prediction:
    """Predict each thing at each pulse from its measurements at all other pulses.

    Args:
        time_s: (t,) of the pulses, in order.
        xyz: (t, n, d) measured values; NaN where not measured.
        covariance: (t, n, d, d) of them.
        velocity: (d,) to begin with.
        mobility: how freely the things move.
    """
    ahead = _filtered(time_s, xyz, covariance, velocity, mobility)
    back = tuple(part[::-1] for part in _filtered(time_s[::-1], xyz[::-1], covariance[::-1], velocity, mobility))
    one, other = np.linalg.inv(ahead[1]), np.linalg.inv(back[1])
    total = np.linalg.inv(one + other)
    state = total @ (one @ ahead[0][..., None] + other @ back[0][..., None])
    d = xyz.shape[2]
    return Prediction(state[..., :d, 0], total[..., :d, :d], state[..., d : 2 * d, 0])


def _filtered(
    time_s: Floats, xyz: Floats, covariance: Floats, velocity: Floats, mobility: Mobility
) -> tuple[Floats, Floats]:
    """States (t, n, 3 d) and covariances (t, n, 3 d, 3 d) before each pulse's own measurement."""
    steps, n, d = xyz.shape
    measured: Flags = np.asarray(np.isfinite(xyz).all(axis=2))
    first = np.nanmean(np.where(measured[..., None], xyz, np.nan), axis=(0, 1)) if measured.any() else np.zeros(d)
    state = np.tile(np.concatenate((first, velocity, np.zeros(d))), (n, 1))
    spread = np.repeat((mobility.place**2, mobility.velocity**2, mobility.acceleration**2), d)
    variance = np.tile(np.diag(spread), (n, 1, 1))
    states, variances = np.empty((steps, n, 3 * d)), np.empty((steps, n, 3 * d, 3 * d))
    for i in range(steps):
        if i:
            dt, begun = float(time_s[i] - time_s[i - 1]), np.asarray(measured[:i].any(axis=0))
            state, variance = _moved(state, variance, dt, begun, mobility.jerk)
        states[i], variances[i] = state, variance
        if (seen := measured[i]).any():
            state, variance = state.copy(), variance.copy()
            gain = variance[seen, :, :d] @ np.linalg.inv(variance[seen, :d, :d] + covariance[i, seen])
            state[seen] += (gain @ (xyz[i, seen] - state[seen, :d])[..., None])[..., 0]
            variance[seen] -= gain @ variance[seen, :d]
    return states, variances


def _moved(state: Floats, variance: Floats, dt: float, begun: Flags, jerk: float) -> tuple[Floats, Floats]:
    """States and covariances dt later (earlier where negative); what was not measured yet keeps its covariance."""
    eye, size = np.eye(state.shape[1] // 3), abs(dt)
    move = np.kron([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]], eye)
    sign = np.sign(dt)
    rows = [
        [size**5 / 20, sign * size**4 / 8, size**3 / 6],
        [sign * size**4 / 8, size**3 / 3, sign * size**2 / 2],
        [size**3 / 6, sign * size**2 / 2, size],
    ]
    grown = move @ variance @ move.T + jerk * np.kron(rows, eye)
    grown = (grown + grown.swapaxes(-1, -2)) / 2
    return state @ move.T, np.where(begun[:, None, None], grown, variance)
