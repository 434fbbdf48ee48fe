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

from analysis.measurements.model import JumpMeasurements, MeasuredCamera, Measurements, PulseMeasurements
from analysis.motion.bundle import Model, begun, near, root_of, settled
from analysis.motion.channels import CHANNELS, SLOPE, MotionFrame
from analysis.motion.gross_errors import without_gross_errors
from analysis.motion.observations import GROUPS, Observations, linearised, observations, used_cameras
from analysis.motion.prior import STATE, prior, start_densities, transitions
from analysis.motion.quantities import known_groups, smoothed_states
from analysis.motion.start_values import start_values
from analysis.result.model import SmoothedState
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Flags, Floats
from rig.clocks import NS_PER_S, UtcNs
from rig.pulse import PulseNumber

_TRIGGER_S: Final = 20e-6  # of cameras that obey one trigger
_STAY_S: Final = 0.15  #: mean time that a motion stays calm, or lively
_GATE_P: Final = 1e-5  #: a measurement that is less likely than this is not used
_STEPS, _REMOVALS = 8, 4
#: How far a jumper's skis turn at all: standard deviations of slope, its difference, heading and opening (rows), of
#: value, speed and acceleration (columns), rad, rad/s, rad/s^2. Nothing may be less certain: so much is known unseen.
_SKI_LIMITS: Final = np.array(((0.45, 2.0, 30.0), (0.3, 1.0, 15.0), (0.25, 1.0, 15.0), (0.5, 2.0, 30.0)))
_MODELS: Final = ("calm", "lively")


@dataclass(frozen=True, slots=True, eq=False)
class _Belief:
    """State and u of one model: (48 + r,) and their covariance."""

    mean: Floats
    covariance: Floats


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
        self._root = root_of(system.covariance)
        self._back = np.linalg.pinv(self._root)
        start = start_densities()
        self._densities = [np.repeat(start[regime : regime + 1], 3, axis=0) for regime in (2, 1)]
        self._waiting: list[PulseMeasurements] = []
        self._frame: MotionFrame | None = None
        self._beliefs: list[_Belief] = []
        self._chances = np.full(len(_MODELS), 1 / len(_MODELS))
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
        return self._result(observed, used, self._known)

    def predicted(self, time: UtcNs) -> SmoothedState | None:
        """Where to look for the jumper at a pulse that is measured next; None before enough pulses are measured.

        Args:
            time: of the pulse.

        Returns:
            A state with all points, also those that were never measured: their covariance tells.
        """
        if self._frame is None:
            return None
        self._advance(time)
        nothing = self._observed((PulseMeasurements(PulseNumber(0), time, {}),))
        return self._result(nothing, nothing.seen, np.ones(len(GROUPS), bool))

    def _observed(self, pulses: tuple[PulseMeasurements, ...]) -> Observations:
        return observations(JumpMeasurements(0, pulses), self._header, self._system)

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
        model = Model(
            observed,
            self._system,
            self._root,
            start.frame,
            prior(observed.times, self._unit, None, self._densities[1]),
            np.zeros(m),
            np.full(m, _TRIGGER_S / self._unit),
        )
        speed = np.gradient(start.channels, observed.times, axis=0) * self._unit
        states = np.concatenate((start.channels, speed, np.zeros_like(speed)), axis=1)
        shared = np.zeros(self._root.shape[1] + m)
        begin = begun(model, states, near(model, states, shared), shared)
        adjusted = without_gross_errors(settled(begin, _STEPS), _REMOVALS)
        rank, solution = self._root.shape[1], adjusted.solution
        cross = solution.cross[:, :, :rank]
        of_u = solution.shared_covariance[:rank, :rank]
        covariance = np.block([[solution.covariance[-1], cross[-1]], [cross[-1].T, of_u]])
        mean = np.concatenate((adjusted.states[-1], adjusted.shared[:rank]))
        self._beliefs = [self._bounded(mean, covariance)] * len(_MODELS)
        self._frame, self._time = start.frame, pulses[-1].time
        self._waiting.clear()
        self._known = known_groups(adjusted.used)
        return self._states(
            observed, adjusted.used, self._known, adjusted.states, solution.covariance, cross @ self._back
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
        change = stay * np.eye(2) + (1 - stay) / 2
        joint = change * self._chances[:, None]
        self._chances = joint.sum(axis=0)
        self._beliefs = [_mixed(self._beliefs, joint[:, k] / self._chances[k]) for k in range(len(_MODELS))]

    def _predict(self, seconds: float) -> None:
        times = np.array((0.0, seconds))
        move = np.eye(len(self._beliefs[0].mean))
        move[:STATE, :STATE] = np.kron(transitions(np.array(seconds / self._unit)), np.eye(CHANNELS))
        beliefs = []
        for belief, density in zip(self._beliefs, self._densities, strict=True):
            covariance = move @ belief.covariance @ move.T
            noise = prior(times, self._unit, None, density).noise()[0]
            for channel in range(CHANNELS):
                at = channel + CHANNELS * np.arange(3)
                covariance[np.ix_(at, at)] += noise[channel]
            beliefs.append(self._bounded(move @ belief.mean, covariance))
        self._beliefs = beliefs

    def _bounded(self, mean: Floats, covariance: Floats) -> _Belief:
        """A belief in which the skis do what skis do, where it was less certain than that.

        A pseudo-observation of zero brings the variance v of such a part of the state down to its limit l: its own
        variance is r = v l / (v - l), so that 1 / v + 1 / r = 1 / l.
        """
        scale = np.array((1.0, self._unit, self._unit**2 / 2))
        for degree, limits in enumerate((_SKI_LIMITS * scale).T):
            for channel, limit in enumerate(limits**2, start=SLOPE):
                at = degree * CHANNELS + channel
                excess = covariance[at, at] - limit
                if excess > 0:
                    gain = covariance[:, at] * excess / covariance[at, at] ** 2
                    mean = mean - gain * mean[at]
                    covariance = covariance - np.outer(gain, covariance[at])
        return _Belief(mean, covariance)

    def _measure(self, frame: MotionFrame, observed: Observations) -> Flags:
        """Use the measurements of a pulse; returns which (1, m, 6)."""
        point = _mixed(self._beliefs, self._chances).mean
        x = point[:STATE].reshape(3, CHANNELS)
        instants = transitions(observed.delay / self._unit)[:, 0]
        equations = linearised(observed, self._system, frame, (instants @ x)[None])
        by_state = np.einsum("id,igac->igadc", instants, equations.by_channels[0]).reshape(-1, STATE)
        by_u = (equations.by_camera[0] @ self._root).reshape(len(by_state), -1)
        rows = np.concatenate((by_state, by_u), axis=1)
        v = equations.v.reshape(-1) + by_u @ point[STATE:]
        used = observed.seen & self._plausible(rows, v, point).reshape(observed.seen.shape)
        take = np.repeat(used.ravel(), 2)
        rows, v = rows[take], v[take]
        likelihood = np.zeros(len(_MODELS))
        beliefs = []
        for k, belief in enumerate(self._beliefs):
            innovation = -(v + rows @ (belief.mean - point))
            spread = rows @ belief.covariance @ rows.T + np.eye(len(v))
            gain = np.linalg.solve(spread, rows @ belief.covariance).T
            likelihood[k] = -(innovation @ np.linalg.solve(spread, innovation) + np.linalg.slogdet(spread)[1]) / 2
            covariance = belief.covariance - gain @ rows @ belief.covariance
            beliefs.append(_Belief(belief.mean + gain @ innovation, (covariance + covariance.T) / 2))
        self._beliefs = beliefs
        weight = self._chances * np.exp(likelihood - likelihood.max())
        self._chances = weight / weight.sum()
        return used

    def _plausible(self, rows: Floats, v: Floats, point: Floats) -> Flags:
        """Which groups of two observations agree with the livelier prediction."""
        lively = self._beliefs[1]
        off = (v + rows @ (lively.mean - point)).reshape(-1, 2)
        pairs = rows.reshape(-1, 2, rows.shape[1])
        spread = pairs @ lively.covariance @ pairs.transpose(0, 2, 1) + np.eye(2)
        distance = np.einsum("ga,gab,gb->g", off, np.linalg.inv(spread), off)
        return np.asarray(distance < chdtri(2, _GATE_P))

    def _result(self, observed: Observations, used: Flags, known: Flags) -> SmoothedState:
        """What both models believe at the pulse of `observed`."""
        belief = _mixed(self._beliefs, self._chances)
        of_state, by_u = belief.covariance[None, :STATE, :STATE], belief.covariance[None, :STATE, STATE:]
        return self._states(observed, used, known, belief.mean[None, :STATE], of_state, by_u @ self._back)[0]

    def _states(
        self,
        observed: Observations,
        used: Flags,
        known: Flags,
        states: Floats,
        covariance: Floats,
        by_calibration: Floats,
    ) -> list[SmoothedState]:
        if self._frame is None:
            raise AssertionError("the filter has not begun")
        by_hand: Flags = np.asarray((observed.by_hand & used).any(axis=1))
        return smoothed_states(
            self._frame,
            self._unit,
            states,
            covariance,
            by_calibration,
            used_cameras(observed, used),
            [dict(zip(GROUPS, of_pulse.tolist(), strict=True)) for of_pulse in by_hand],
            known,
            vague=np.inf,  # the filter itself bounds what it does not know, and whoever follows needs all parts
        )


def _mixed(beliefs: list[_Belief], weights: Floats) -> _Belief:
    """One normal distribution with mean and covariance of a mixture."""
    mean = np.einsum("k,ks->s", weights, [belief.mean for belief in beliefs])
    covariance = np.zeros((len(mean), len(mean)))
    for weight, belief in zip(weights, beliefs, strict=True):
        off = belief.mean - mean
        covariance += weight * (belief.covariance + np.outer(off, off))
    return _Belief(mean, covariance)
