"""What is to be expected at a pulse by what was measured before and after it, not at it: two Kalman filters that meet.

Places of markers and angles of skis move alike: their second derivative changes as a random walk (white jerk). The
strength of the walk is that of a jumper's strongest movements: the prediction is a gate and pulls no measurement. What
moves stiffly together is described by its parts: both bindings by their midpoint and by half the way between them, so
that the one that is hidden is where the other one tells.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from rig.arrays import Flags, Floats


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Something that moves on its own.

    Attributes:
        begin: (2, d) value and velocity before anything is measured, in units and units per s.
        sigma: standard deviations of value, velocity and acceleration then, each a number or one (d,) by coordinate.
        jerk: by how much the acceleration changes within 0.1 s, standard deviation, units per s^2; likewise.
    """

    begin: Floats
    sigma: tuple[float | Floats, float | Floats, float | Floats]
    jerk: float | Floats


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Predicted values of n things at t pulses.

    Attributes:
        xyz: (t, n, d) places with d coordinates, or angles.
        covariance: (t, n, d, d).
    """

    xyz: Floats
    covariance: Floats


def predict(time_s: Floats, xyz: Floats, covariance: Floats, parts: Sequence[Part], mixing: Floats) -> Prediction:
    """Predict each thing at each pulse from what was measured at all other pulses.

    Args:
        time_s: (t,) of the pulses, in order.
        xyz: (t, n, d) measured values; NaN where not measured.
        covariance: (t, n, d, d) of them.
        parts: p of them.
        mixing: (n, p) the things as sums of parts.
    """
    filters = PathFilter(xyz.shape[2], parts, mixing)
    ahead = filters.run(time_s, xyz, covariance)
    back = tuple(part[::-1] for part in filters.run(time_s[::-1], xyz[::-1], covariance[::-1]))
    one, other = np.linalg.inv(ahead[1]), np.linalg.inv(back[1])
    total = np.linalg.inv(one + other)
    state = (total @ (one @ ahead[0][..., None] + other @ back[0][..., None]))[..., 0]
    steps, n, d = xyz.shape
    values = (state @ filters.all_of.T).reshape(steps, n, d)
    spread = (filters.all_of @ total @ filters.all_of.T).reshape(steps, n, d, n, d)
    return Prediction(values, np.stack([spread[:, i, :, i] for i in range(n)], axis=1))


class PathFilter:
    """A Kalman filter whose state is value, velocity and acceleration of each part in turn.

    Attributes:
        all_of: (n d, 3 d p) all things by the state.
        mixing: (n, p) the things as sums of parts.
        begin: state (3 d p,) before anything is measured, and its standard deviations.

    Args:
        d: coordinates of a thing.
        parts: p of them.
        mixing: (n, p) the things as sums of parts.
    """

    def __init__(self, d: int, parts: Sequence[Part], mixing: Floats) -> None:
        self._d, self.mixing = d, mixing
        self._jerk = [np.broadcast_to(part.jerk, d) ** 2 / 0.1 for part in parts]
        mean = np.concatenate([np.concatenate((part.begin.ravel(), np.zeros(d))) for part in parts])
        self.begin = mean, np.concatenate([np.broadcast_to(s, d) for part in parts for s in part.sigma])
        self._movements: dict[float, tuple[Floats, Floats]] = {}
        self.all_of = np.kron(mixing, np.kron([[1.0, 0.0, 0.0]], np.eye(d)))

    def _movement(self, dt: float) -> tuple[Floats, Floats]:
        """What becomes of a state after dt, and the covariance that is added."""
        if dt not in self._movements:
            eye, size, sign = np.eye(self._d), abs(dt), float(np.sign(dt))
            taylor = np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
            move = np.kron(np.eye(len(self._jerk)), np.kron(taylor, eye))
            rows = np.array(
                [
                    [size**5 / 20, sign * size**4 / 8, size**3 / 6],
                    [sign * size**4 / 8, size**3 / 3, sign * size**2 / 2],
                    [size**3 / 6, sign * size**2 / 2, size],
                ]
            )
            noise = block_diag(*(np.kron(rows, np.diag(jerk)) for jerk in self._jerk))
            self._movements[dt] = np.asarray(move, float), np.asarray(noise, float)
        return self._movements[dt]

    def run(self, time_s: Floats, xyz: Floats, covariance: Floats) -> tuple[Floats, Floats]:
        """States (t, 3 d p) and their covariances before each pulse's own measurement."""
        measured: Flags = np.asarray(np.isfinite(xyz).all(axis=2))
        state, variance = self.begin[0], np.diag(self.begin[1] ** 2)
        begun = np.zeros(len(self._jerk), bool)
        states, variances = np.empty((len(time_s), len(state))), np.empty((len(time_s), len(state), len(state)))
        for i in range(len(time_s)):
            if i:
                state, variance = self.moved(state, variance, float(time_s[i] - time_s[i - 1]), begun)
            states[i], variances[i] = state, variance
            if measured[i].any():
                state, variance = self._updated(state, variance, measured[i], xyz[i], covariance[i])
                begun |= (self.mixing[measured[i]] != 0).any(axis=0)
        return states, variances

    def _updated(
        self, state: Floats, variance: Floats, measured: Flags, xyz: Floats, covariance: Floats
    ) -> tuple[Floats, Floats]:
        by_state = self.all_of[np.repeat(measured, self._d)]
        total = by_state @ variance @ by_state.T
        for i, own in enumerate(covariance[measured]):
            block = slice(i * self._d, (i + 1) * self._d)
            total[block, block] += own
        gain = np.linalg.solve(total, by_state @ variance).T
        variance = variance - gain @ by_state @ variance
        return state + gain @ (xyz[measured].ravel() - by_state @ state), (variance + variance.T) / 2

    def moved(self, state: Floats, variance: Floats, dt: float, begun: Flags) -> tuple[Floats, Floats]:
        """States (..., 3 d p) and covariances dt later (earlier where negative).

        Parts that were not measured yet, begun (..., p), stay as uncertain as they are.
        """
        move, noise = self._movement(round(dt, 6))
        grown = move @ variance @ move.T + noise
        known = np.repeat(begun, 3 * self._d, axis=-1)
        grown = np.where(known[..., :, None] & known[..., None, :], grown, variance)
        return state @ move.T, (grown + grown.swapaxes(-1, -2)) / 2
