"""Predicts values at a pulse from measurements before and after it, not at it: two Kalman filters that meet.

Places of markers and angles of skis move alike: their second derivative changes as a random walk (white jerk). The
strength of the walk is that of a jumper's strongest movements: the prediction is a gate and pulls no measurement. What
moves stiffly together is described by its parts: both bindings by their midpoint and by half the way between them, so
that the visible binding predicts the hidden one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.linalg import block_diag

from rig.arrays import Flags, Floats

_States: TypeAlias = tuple[Floats, Floats]  # with their covariances


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
    ahead, back = filters.run(time_s, xyz, covariance)
    steps, n, d = xyz.shape
    # the weighted mean of both filters, for the wanted things only: the weight of `back` is its share of the variances
    asked = filters.all_of @ ahead[1]
    share = np.linalg.solve(ahead[1] + back[1], asked.swapaxes(-1, -2)).swapaxes(-1, -2)
    values = ahead[0] @ filters.all_of.T + (share @ (back[0] - ahead[0])[..., None])[..., 0]
    spread = (share @ back[1] @ filters.all_of.T).reshape(steps, n, d, n, d)
    return Prediction(values.reshape(steps, n, d), np.stack([spread[:, i, :, i] for i in range(n)], axis=1))


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

    def run(self, time_s: Floats, xyz: Floats, covariance: Floats) -> tuple[_States, _States]:
        """States (t, 3 d p) and their covariances before each pulse's own measurement, ahead and back in time."""
        steps, n, d = xyz.shape
        measured: Flags = np.asarray(np.isfinite(xyz).all(axis=2))
        values, spread = np.nan_to_num(xyz.reshape(steps, n * d)), np.zeros((steps, n * d, n * d))
        for i in range(n):
            block = slice(i * d, (i + 1) * d)
            spread[:, block, block] = np.where(measured[:, i, None, None], covariance[:, i], np.eye(d))
        by_state = np.where(np.repeat(measured, d, axis=1)[..., None], self.all_of, 0.0)
        begins = measured @ (self.mixing != 0)
        size = len(self.begin[0])
        state, variance = np.tile(self.begin[0], (2, 1)), np.tile(np.diag(self.begin[1] ** 2), (2, 1, 1))
        begun = np.zeros((2, len(self._jerk)), bool)
        states, variances = np.empty((2, steps, size)), np.empty((2, steps, size, size))
        both = np.arange(2)
        for i in range(steps):
            at = np.array((i, steps - 1 - i))
            if i:
                state, variance = self.moved(state, variance, time_s[at] - time_s[at - (1, -1)], begun)
            states[both, at], variances[both, at] = state, variance
            if measured[at].any():
                state, variance = _updated(state, variance, by_state[at], values[at], spread[at])
                begun |= begins[at]
        return (states[0], variances[0]), (states[1], variances[1])

    def moved(self, state: Floats, variance: Floats, dt: Floats, begun: Flags) -> _States:
        """States (h, 3 d p) and covariances dt (h,) later (earlier where negative), or all the same dt (1,) later.

        Parts that were not measured yet, begun (h, p), stay as uncertain as they are.
        """
        movements = [self._movement(round(each, 6)) for each in dt.tolist()]
        move, noise = (np.stack(parts) for parts in zip(*movements, strict=True))
        grown = move @ variance @ move.swapaxes(-1, -2) + noise
        known = np.repeat(begun, 3 * self._d, axis=-1)
        grown = np.where(known[..., :, None] & known[..., None, :], grown, variance)
        return (move @ state[..., None])[..., 0], (grown + grown.swapaxes(-1, -2)) / 2


def _updated(state: Floats, variance: Floats, by_state: Floats, values: Floats, spread: Floats) -> _States:
    """States (h, s) and covariances after a measurement: values (h, k) with their derivatives and covariances."""
    total = by_state @ variance @ by_state.swapaxes(-1, -2) + spread
    gain = np.linalg.solve(total, by_state @ variance).swapaxes(-1, -2)
    variance = variance - gain @ by_state @ variance
    off = values[..., None] - by_state @ state[..., None]
    return state + (gain @ off)[..., 0], (variance + variance.swapaxes(-1, -2)) / 2
