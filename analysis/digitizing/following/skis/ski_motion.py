"""The motion of a pair of skis from pulse to pulse: bindings with white noise on the jerk, turns with it on their rate.

The state of each ski is place, velocity and acceleration of its binding, the two turns of its direction and their
rates, with the pulse interval as unit of time. Turns are counted from the direction that is believed.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.digitizing.following.points.motion import ACCELERATION, KnownMotion
from analysis.motion.model.prior import LIVELIEST, transitions, white_jerk
from analysis.ski_bars.bars import SKIS, Poses
from rig.arrays import Floats

_PLACE, _TURN, _SIZE = 9, 11, 13  # of a ski: where the turns, and where their rates begin, and all
#: Skis are turned to the wind with some 1.5 rad/s, which they take on in 0.2 s.
_RATE: Final = 1.5
_RATE_DENSITY: Final = _RATE**2 / 0.2  # of the noise on the turns' acceleration, rad^2/s^3
_POSE: Final = np.concatenate([_SIZE * k + np.array((0, 1, 2, 9, 10)) for k in range(SKIS)])


@dataclass(frozen=True, slots=True, eq=False)
class PairBelief:
    """What is believed of a pair of skis.

    Attributes:
        poses: where they are.
        velocity, acceleration: (2, 3) of the bindings, m per pulse, m per pulse^2.
        rate: (2, 2) of the turns to the side and in the vertical plane, rad per pulse.
        covariance: (26, 26) of both states.
    """

    poses: Poses
    velocity: Floats
    acceleration: Floats
    rate: Floats
    covariance: Floats

    @property
    def pose_covariance(self) -> Floats:
        """(10, 10) as `ExpectedBars` has it."""
        return np.asarray(self.covariance[np.ix_(_POSE, _POSE)])


class PairMotion:
    """Predicts and updates beliefs.

    Args:
        interval_s: between pulses.
    """

    def __init__(self, interval_s: float) -> None:
        self._interval = interval_s

    def begun(self, poses: Poses, covariance: Floats, known: list[KnownMotion]) -> PairBelief:
        """At poses with a covariance (10, 10), with what is known of the motion of each binding."""
        h = self._interval
        spread = np.zeros((SKIS, _SIZE))
        spread[:, 3:6] = np.array([each.sigma for each in known])[:, None] * h
        spread[:, 6:_PLACE] = ACCELERATION * h**2 / 2
        spread[:, _TURN:] = _RATE * h
        whole = np.diag(spread.ravel() ** 2)
        whole[np.ix_(_POSE, _POSE)] = covariance
        velocity = np.array([each.velocity for each in known]) * h
        return PairBelief(poses, velocity, np.zeros((SKIS, 3)), np.zeros((SKIS, 2)), whole)

    def predicted(self, belief: PairBelief, steps: int) -> PairBelief:
        """After so many pulses, also backward."""
        h = self._interval
        one, noise = np.eye(_SIZE), np.zeros((_SIZE, _SIZE))
        move = transitions(np.array(float(steps)))
        one[:_PLACE, :_PLACE] = np.kron(move, np.eye(3))
        one[_PLACE:_TURN, _TURN:] = steps * np.eye(2)
        sign = np.sign(steps) ** np.arange(3)
        jerk = white_jerk(np.array(abs(steps) * h), h) * np.outer(sign, sign)
        noise[:_PLACE, :_PLACE] = np.kron(jerk, np.eye(3)) * LIVELIEST
        n, s = abs(steps), np.sign(steps)
        turning = np.array(((n**3 / 3, s * n**2 / 2), (s * n**2 / 2, n))) * _RATE_DENSITY * h**3
        noise[_PLACE:, _PLACE:] = np.kron(turning, np.eye(2))
        whole = np.kron(np.eye(SKIS), one)
        moving = np.stack((belief.poses.point, belief.velocity, belief.acceleration), axis=1)
        place, velocity, acceleration = (np.einsum("ij,kjd->kid", move, moving)[:, i] for i in range(3))
        turn = np.column_stack((place - belief.poses.point, steps * belief.rate))
        covariance = whole @ belief.covariance @ whole.T + np.kron(np.eye(SKIS), noise)
        return PairBelief(belief.poses.moved(turn), velocity, acceleration, belief.rate, covariance)

    def updated(self, belief: PairBelief, poses: Poses, covariance: Floats) -> PairBelief:
        """With poses that were fitted from this belief on, and their covariance (10, 10) with it."""
        before = belief.pose_covariance
        gain = np.linalg.solve(before, belief.covariance[_POSE]).T
        step = (gain @ belief.poses.step_to(poses).ravel()).reshape(SKIS, _SIZE)
        after = belief.covariance + gain @ (covariance - before) @ gain.T
        return PairBelief(
            poses,
            belief.velocity + step[:, 3:6],
            belief.acceleration + step[:, 6:_PLACE],
            belief.rate + step[:, _TURN:],
            (after + after.T) / 2,
        )
