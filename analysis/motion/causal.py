"""The causal version of the bundle: the jumper at each pulse from the past alone, as the pulses come.

A Kalman filter on the same equations and the same prior, with the uncertain parameters of the cameras in its state. A
filter does not know yet how lively the motion is, so two go side by side, calm and lively, and mix by their likelihoods
(interacting multiple models, Blom and Bar-Shalom 1988). The bundle of the whole jump replaces all of it afterwards.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.measurements.model import POINTS, JumpMeasurements, MeasuredCamera, Measurements, PulseMeasurements
from analysis.motion.adjustment.bundle import Model, begun, near, root_of, settled
from analysis.motion.adjustment.gross_errors import without_gross_errors
from analysis.motion.model.channels import CHANNELS, ORIGIN, SLOPE, VECTORS, MotionFrame
from analysis.motion.model.equations import linearised
from analysis.motion.model.observations import GROUPS, Observations, by_hand, observations, used_cameras
from analysis.motion.model.prior import SHARE, STATE, prior, start_densities, transitions, white_jerk
from analysis.motion.quantities import known_groups, smoothed_states
from analysis.motion.start_values import start_values
from analysis.result.model import SmoothedState
from analysis.scene.camera_arrays import CameraArrays, own_root
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Flags, Floats
from rig.clocks import NS_PER_S, UtcNs

_TRIGGER_S: Final = 20e-6  # of cameras that obey one trigger
_STAY_S: Final = 0.15  #: mean time that a motion stays calm, or lively
_GATE_P: Final = 1e-5  #: a measurement that is less likely than this is not used
#: Likewise of a ski that fewer images show than contradict each other if one is wrong.
_ALONE_P: Final = 1e-3
_CONTROLLED: Final = 3
_STEPS_MOST, _REMOVALS = 8, 4
#: How far a jumper's skis turn at all: standard deviations of slope, its difference, heading and opening (rows), of
#: value, speed and acceleration (columns), rad, rad/s, rad/s^2. Nothing may be less certain: so much is known unseen.
_SKI_LIMITS: Final = np.array(((0.45, 2.0, 30.0), (0.3, 1.0, 15.0), (0.25, 1.0, 15.0), (0.5, 2.0, 30.0)))
#: The vectors of a jumper's body, from the crouch to the flight: means and standard deviations, m, in the order of the
#: channels. So much is known of what nobody has seen (`analysis.identification.space.body`); aside, the hip stays above
#: the skis.
_BODY: Final = np.array((0.25, 0, 0.6, 0.6, 0, 0.25, 0, 0.45, 0), float)
_BODY_SIGMA: Final = np.array((0.30, 0.12, 0.17, 0.20, 0.12, 0.25, 0.12, 0.14, 0.10))
_BOUNDED: Final = (np.arange(3)[:, None] * CHANNELS + np.arange(SLOPE, CHANNELS)).ravel()  # places of their transpose
_REGIMES: Final = (2, 1)  #: of `prior`: the models are calm as in flight, lively as at the edge
_CALM, _LIVELY = range(len(_REGIMES))
_OF_CHANNEL: Final = np.arange(CHANNELS)[:, None] + CHANNELS * np.arange(3)  # (16, 3) its places in a state
_UNSEEN: Final[Mapping[str, tuple[str, ...]]] = dict.fromkeys(GROUPS, ())
_BY_NOBODY: Final = dict.fromkeys(GROUPS, False)


@dataclass(frozen=True, slots=True, eq=False)
class _Beliefs:
    """State and u of k models.

    Attributes:
        mean: (k, 48 + r).
        covariance: (k, 48 + r, 48 + r).
    """

    mean: Floats
    covariance: Floats

    def mixed(self, weights: Floats) -> "_Beliefs":
        """Normal distributions with mean and covariance of j mixtures, by the weights (j, k) of the models."""
        mean = weights @ self.mean
        off = self.mean - mean[:, None]
        apart = (off * weights[:, :, None]).swapaxes(1, 2) @ off
        return _Beliefs(mean, np.tensordot(weights, self.covariance, 1) + apart)


class CausalFilter:
    """The filter of one jump; give it the pulses in order.

    Args:
        system: the oriented cameras.
        cameras: their exposures, by name.
        rate_hz: pulses per second.
    """

    def __init__(self, system: CameraSystem, cameras: Mapping[str, MeasuredCamera], rate_hz: float) -> None:
        self._system = system
        self._header = Measurements("", rate_hz, cameras, ())
        self._unit = 1.0 / rate_hz
        self._cameras = CameraArrays.of(system, tuple(cameras))
        self._root = root_of(system.covariance)
        self._own_root = own_root(system, self._cameras.names, self._root)
        self._back = np.linalg.pinv(self._root)
        self._densities = start_densities()[_REGIMES, :]
        self._waiting: list[PulseMeasurements] = []
        self._frame: MotionFrame | None = None
        self._beliefs = _Beliefs(np.empty(0), np.empty(0))
        self._chances = np.full(len(_REGIMES), 1 / len(_REGIMES))
        self._time = UtcNs(0)
        self._known: Flags = np.zeros(len(GROUPS), bool)

    def update(self, pulse: PulseMeasurements) -> SmoothedState | None:
        """The jumper at this pulse; None before enough pulses are measured."""
        if self._frame is None:
            self._waiting.append(pulse)
            states = self.begin(tuple(self._waiting))
            return states[-1] if states else None
        observed = self._observed((pulse,))
        self._advance(pulse.time)
        used = self._measure(self._frame, observed)
        self._known |= known_groups(used)
        belief = self._beliefs.mixed(self._chances[None])
        return self._results(self._frame, belief, used_cameras(observed, used), by_hand(observed, used), self._known)[0]

    def predicted(self, time: UtcNs) -> tuple[SmoothedState, SmoothedState] | None:
        """The jumper at a pulse that is measured next; None before enough pulses are measured.

        Args:
            time: of the pulse.

        Returns:
            A state with all points; points that were never measured have a large covariance. And a second state, in
            which points and skis out of sight for long are where a body has them. It shows where to look, not what is
            there: a binding could be the other one. The filter itself does not use it: entered again at every pulse,
            the same knowledge would count many times.
        """
        if self._frame is None:
            return None
        self._advance(time)
        belief = self._beliefs.mixed(self._chances[None])
        with_body = _with_body(belief)
        mean = np.concatenate((belief.mean, with_body.mean))
        both = _Beliefs(mean, np.concatenate((belief.covariance, with_body.covariance)))
        known, searched = self._results(self._frame, both, [_UNSEEN], [_BY_NOBODY], np.ones(len(GROUPS), bool))
        return known, searched

    def _observed(self, pulses: tuple[PulseMeasurements, ...]) -> Observations:
        return observations(JumpMeasurements(0, pulses), self._header, self._cameras)

    def begin(self, pulses: Sequence[PulseMeasurements]) -> list[SmoothedState]:
        """Begin with a small bundle of the first pulses.

        Args:
            pulses: the first ones, in order.

        Returns:
            The states of the last of them, from the first measured one on; none if these are not enough to begin.
        """
        observed = self._observed(tuple(pulses))
        measured = np.flatnonzero(observed.seen.any(axis=(1, 2)))
        if not len(measured) or not observed.seen[-1].any():
            return []
        observed = observed.part(slice(int(measured[0]), None))
        if len(observed.times) < 2 or (start := start_values(observed, self._system)) is None:
            return []
        m = len(observed.names)
        lively = np.repeat(self._densities[_LIVELY : _LIVELY + 1], 3, axis=0)
        model = Model(
            observed,
            self._cameras,
            self._root,
            self._own_root,
            start.frame,
            prior(observed.times, self._unit, None, lively),
            np.zeros(m),
            np.full(m, _TRIGGER_S / self._unit),
        )
        speed = np.gradient(start.channels, observed.times, axis=0) * self._unit
        states = np.concatenate((start.channels, speed, np.zeros_like(speed)), axis=1)
        shared = np.zeros(self._root.shape[1] + m)
        begin = begun(model, states, near(model, states, shared), shared)
        adjusted = without_gross_errors(settled(begin, _STEPS_MOST), _REMOVALS)
        rank, solution = self._root.shape[1], adjusted.solution
        cross = solution.cross[:, :, :rank]
        of_u = solution.shared_covariance[:rank, :rank]
        covariance = np.block([[solution.covariance[-1], cross[-1]], [cross[-1].T, of_u]])
        mean = np.concatenate((adjusted.states[-1], adjusted.shared[:rank]))
        both = self._bounded(mean, covariance)
        self._beliefs = _Beliefs(*(np.stack([part] * len(_REGIMES)) for part in both))
        self._frame, self._time = start.frame, pulses[-1].time
        self._waiting.clear()
        self._known = known_groups(adjusted.used)
        return smoothed_states(
            self._frame,
            self._unit,
            adjusted.states,
            solution.covariance,
            cross @ self._back,
            used_cameras(observed, adjusted.used),
            by_hand(observed, adjusted.used),
            self._known,
            vague=np.inf,  # as in `_results`
        )

    def _advance(self, time: UtcNs) -> None:
        """Predict the motion at a time, unless that was done."""
        seconds = (time - self._time) / NS_PER_S
        if seconds > 0:
            self._time = time
            self._mix(seconds)
            self._predict(seconds)

    def _mix(self, seconds: float) -> None:
        """Each model starts from both, by the chance that the motion was the other's and changed."""
        stay = np.exp(-seconds / _STAY_S)
        change = stay * np.eye(len(_REGIMES)) + (1 - stay) / 2
        joint = change * self._chances[:, None]
        self._chances = joint.sum(axis=0)
        self._beliefs = self._beliefs.mixed((joint / self._chances).T)

    def _predict(self, seconds: float) -> None:
        move = transitions(np.array(seconds / self._unit))
        mean, covariance = self._beliefs.mean.copy(), self._beliefs.covariance
        mean[:, :STATE] = _moved(move, mean[:, :STATE, None])[..., 0]
        for _ in range(2):  # the rows, then the columns
            rows = covariance.swapaxes(1, 2).copy()
            rows[:, :STATE] = _moved(move, rows[:, :STATE])
            covariance = rows
        jerk = white_jerk(np.array([seconds]), self._unit)[0]
        noise = self._densities[:, SHARE, None, None] * jerk
        covariance[:, _OF_CHANNEL[:, :, None], _OF_CHANNEL[:, None]] += noise
        bounded = [self._bounded(*of_model) for of_model in zip(mean, covariance, strict=True)]
        self._beliefs = _Beliefs(*(np.stack(part) for part in zip(*bounded, strict=True)))

    def _bounded(self, mean: Floats, covariance: Floats) -> tuple[Floats, Floats]:
        """Mean and covariance of a model with the skis bounded to how skis move, wherever it was less certain.

        A pseudo-observation of zero brings the variance v of such a part of the state down to its limit l: its own
        variance is r = v l / (v - l), so that 1 / v + 1 / r = 1 / l.
        """
        scale = np.array((1.0, self._unit, self._unit**2 / 2))
        limits = ((_SKI_LIMITS * scale).T ** 2).ravel()
        for k in np.flatnonzero(np.diagonal(covariance)[_BOUNDED] > limits):
            at = _BOUNDED[k]
            excess = covariance[at, at] - limits[k]
            if excess > 0:  # still: each of them makes the others more certain
                gain = covariance[:, at] * excess / covariance[at, at] ** 2
                mean = mean - gain * mean[at]
                covariance = covariance - np.outer(gain, covariance[at])
        return mean, covariance

    def _measure(self, frame: MotionFrame, observed: Observations) -> Flags:
        """Use the measurements of a pulse; returns which (1, m, 6)."""
        mean, covariance = self._beliefs.mean, self._beliefs.covariance
        point = self._chances @ mean
        instants = transitions(observed.delay / self._unit)[:, 0]
        channels = instants @ point[:STATE].reshape(3, CHANNELS)
        equations = linearised(observed, self._cameras, self._own_root, frame, channels[None])
        by_state = (instants[:, None, None, :, None] * equations.by_channels[0, ..., None, :]).reshape(-1, STATE)
        by_u = equations.by_u.reshape(len(by_state), -1)
        rows = np.concatenate((by_state, by_u), axis=1)
        v = equations.v.reshape(-1) + by_u @ point[STATE:]
        off = v + (mean - point) @ rows.T
        cross = rows @ covariance
        used = _plausible(observed, _distances(off[_LIVELY], rows, cross[_LIVELY]))
        take = np.repeat(used.ravel(), 2)
        off, cross, rows = off[:, take], cross[:, take], rows[take]
        spread = cross @ rows.T + np.eye(len(rows))
        solved = np.linalg.solve(spread, np.concatenate((cross, off[..., None]), axis=2))
        gain, pull = solved[..., :-1].swapaxes(1, 2), solved[..., -1]
        likelihood = -((off * pull).sum(axis=1) + np.linalg.slogdet(spread)[1]) / 2
        after = covariance - gain @ cross
        moved = (gain @ off[..., None])[..., 0]
        self._beliefs = _Beliefs(mean - moved, (after + after.swapaxes(1, 2)) / 2)
        weight = self._chances * np.exp(likelihood - likelihood.max())
        self._chances = weight / weight.sum()
        return used

    def _results(
        self,
        frame: MotionFrame,
        belief: _Beliefs,
        cameras: Sequence[Mapping[str, tuple[str, ...]]],
        hands: Sequence[Mapping[str, bool]],
        known: Flags,
    ) -> list[SmoothedState]:
        """The states of k beliefs at one pulse; `cameras` and `hands` are the sources of its measurements."""
        return smoothed_states(
            frame,
            self._unit,
            belief.mean[:, :STATE],
            belief.covariance[:, :STATE, :STATE],
            belief.covariance[:, :STATE, STATE:] @ self._back,
            [*cameras] * len(belief.mean),
            [*hands] * len(belief.mean),
            known,
            vague=np.inf,  # the filter itself bounds what it does not know, and whoever follows needs all parts
        )


def _with_body(belief: _Beliefs) -> _Beliefs:
    """A belief (k = 1) of a jumper whose body is one of people."""
    vectors = slice(ORIGIN.stop, VECTORS)
    mean, rows = belief.mean[0], belief.covariance[0, vectors]
    gain = np.linalg.solve(rows[:, vectors] + np.diag(_BODY_SIGMA**2), rows).T
    return _Beliefs((mean + gain @ (_BODY - mean[vectors]))[None], (belief.covariance[0] - gain @ rows)[None])


def _moved(move: Floats, rows: Floats) -> Floats:
    """Rows (k, 48, f) of states, one after a motion (3, 3) of each channel."""
    return np.asarray((move @ rows.reshape(len(rows), 3, -1)).reshape(rows.shape))


def _plausible(observed: Observations, distances: Floats) -> Flags:
    """Which measurements (1, m, 6) agree with a prediction, by their chi-squares against it.

    Two images of a ski, or one, do not contradict each other whatever they show; there the prediction is the only
    control, and judges as strictly as the motion over time does afterwards. Measurements by hand are exempt from that.
    """
    distance = distances.reshape(observed.seen.shape)
    used = observed.seen & (distance < chdtri(2, _GATE_P))
    alone = (used.sum(axis=1, keepdims=True) < _CONTROLLED) & (np.arange(len(GROUPS)) >= len(POINTS))
    return np.asarray(used & ~(alone & ~observed.by_hand & (distance > chdtri(2, _ALONE_P))))


def _distances(off: Floats, rows: Floats, cross: Floats) -> Floats:
    """Chi-squares (g,) of groups of two observations against a prediction.

    Args:
        off: (2 g,) computed - observed.
        rows: (2 g, s) derivatives by the state.
        cross: (2 g, s) these times the covariance of the state.
    """
    pairs = rows.reshape(-1, 2, rows.shape[1])
    spread = cross.reshape(pairs.shape) @ pairs.swapaxes(1, 2) + np.eye(2)
    apart = off.reshape(-1, 2, 1)
    return np.asarray((apart * np.linalg.solve(spread, apart)).sum(axis=(1, 2)))
