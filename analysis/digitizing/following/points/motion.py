"""The motion of a tracked thing from pulse to pulse: a Kalman filter with white noise on the jerk.

Its state is place, velocity and acceleration, and for each camera the offset of what is tracked from the thing itself:
a mark by hand is off by some tenths of a pixel, and whatever is matched to it afterwards is off by the same. The offset
begins with the mark's covariance and that of the cameras, which is common to all of them, and takes a random step when
a younger image takes the place of the marked one. So neither the gate nor the sigmas mistake it for fresh noise.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.digitizing.following.points.views import Views
from analysis.motion.model.prior import LIVELIEST, transitions, white_jerk
from rig.arrays import Floats, Integers

_SPEED, _PLACE = 30.0, 100.0  # standard deviations before anything is known, m/s, m
ACCELERATION: Final = 20.0  #: standard deviation of an acceleration, m/s^2
#: By which a frame is off beside its shift: lenses, rolling air, a turn about the axis. Covariance (2, 2), px^2.
UNSTEADY: Final = 0.07**2 * np.eye(2)
_ITERATIONS = 3  # of an update: the images are not linear in space
_TINY = 1e-4  # px, of a mark against its own offset


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """A thing in one image.

    Attributes:
        xy: (2,) px.
        covariance: (2, 2) px^2.
        shift: (2,) px by which the image is off, see `Picture`.
        has_offset: whether it is off by its camera's offset.
    """

    xy: Floats
    covariance: Floats
    shift: Floats
    has_offset: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """Mean and covariance of the state; velocity and acceleration with the pulse interval as unit of time."""

    mean: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True, eq=False)
class KnownMotion:
    """What is known of a motion before it is tracked.

    Attributes:
        velocity: (3,) m/s.
        sigma: m/s, of each coordinate.
    """

    velocity: Floats
    sigma: float


class Motion:
    """Predicts and updates beliefs.

    Args:
        views: the images.
        interval_s: between pulses.
        late_s: by camera, how much later than the pulse its exposure is; cameras that are not named: 0.
    """

    def __init__(self, views: Views, interval_s: float, late_s: Mapping[str, float]) -> None:
        self.views, self._interval = views, interval_s
        self._late = {name: late_s.get(name, 0.0) / interval_s for name in views.names}
        self._d = views.dimensions
        self._moving = 3 * self._d
        self._size = self._moving + 2 * len(views.names)

    def begun(self, place: Floats, known: KnownMotion | None) -> Belief:
        """Near a place, with a velocity that may be anything a jumper has."""
        unit, h = self.views.unit, self._interval
        mean, spread = np.zeros(self._size), np.zeros(self._size)
        mean[: self._d] = place
        spread[: self._moving] = np.repeat((_PLACE, _SPEED * h, ACCELERATION * h**2 / 2), self._d) * unit
        if known is not None and self._d == 3:
            mean[3:6] = known.velocity * h
            spread[3:6] = known.sigma * h
        return Belief(mean, np.diag(spread**2))

    def predicted(self, belief: Belief, steps: float) -> Belief:
        """After so many pulses, also backward."""
        d, moving = self._d, self._moving
        move = np.eye(self._size)
        move[:moving, :moving] = np.kron(transitions(np.array(steps)), np.eye(d))
        jerk = white_jerk(np.array(abs(steps) * self._interval), self._interval)
        sign = np.sign(steps) ** np.arange(3)
        noise = np.zeros_like(belief.covariance)
        noise[:moving, :moving] = np.kron(jerk * np.outer(sign, sign), np.eye(d)) * LIVELIEST * self.views.unit**2
        return Belief(move @ belief.mean, move @ belief.covariance @ move.T + noise)

    def seen(self, belief: Belief, name: str, *, with_offset: bool) -> tuple[Floats, Floats]:
        """Where a camera should see the thing, (2,) px, and its covariance (2, 2)."""
        xy, rows = self._linearised(belief.mean, name, with_offset)
        return xy, rows @ belief.covariance @ rows.T

    def place(self, belief: Belief) -> Floats:
        """Where the thing is."""
        return belief.mean[: self._d]

    def velocity(self, belief: Belief) -> Floats:
        """Its velocity, m/s in space."""
        return belief.mean[self._d : 2 * self._d] / self._interval

    def updated(self, belief: Belief, seen: Mapping[str, Observation]) -> tuple[Belief, float]:
        """The belief with observations, and their chi-squared against it, redundancy 2 for each (NaN: impossible)."""
        observed = np.concatenate([each.xy - each.shift for each in seen.values()])
        noise = np.zeros((len(observed),) * 2)
        for i, each in enumerate(seen.values()):
            noise[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = each.covariance
        mean, off = belief.mean, np.empty(0)
        for _ in range(_ITERATIONS):
            parts = [self._linearised(mean, name, each.has_offset) for name, each in seen.items()]
            rows = np.concatenate([part[1] for part in parts])
            off = observed - np.concatenate([part[0] for part in parts]) - rows @ (belief.mean - mean)
            cross = belief.covariance @ rows.T
            spread = rows @ cross + noise
            solved = np.linalg.solve(spread, np.column_stack((cross.T, off)))
            before, mean = mean, belief.mean + cross @ solved[:, -1]
            if not np.isfinite(mean).all():
                return belief, float("nan")
            if np.abs(rows @ (mean - before)).max() < 1e-3:
                break
        covariance = belief.covariance - cross @ solved[:, :-1]
        return Belief(mean, (covariance + covariance.T) / 2), float(off @ solved[:, -1])

    def anchored(self, belief: Belief, anchors: Mapping[str, Floats]) -> Belief:
        """With new offsets, of covariance (2, 2) px^2 by camera, and what the uncertain cameras add to all."""
        names = tuple(anchors)
        at: Integers = np.concatenate([self._offset(name) for name in names])
        mean, covariance = belief.mean.copy(), belief.covariance.copy()
        mean[at], covariance[at], covariance[:, at] = 0.0, 0.0, 0.0
        shared = self.views.shared(names, self.place(belief))
        for i, anchor in enumerate(anchors.values()):
            shared[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += anchor + UNSTEADY
        covariance[np.ix_(at, at)] = shared
        return Belief(mean, covariance)

    def stepped(self, belief: Belief, name: str, step: Floats) -> Belief:
        """With a camera's offset less certain by a covariance (2, 2) px^2."""
        at = self._offset(name)
        covariance = belief.covariance.copy()
        covariance[np.ix_(at, at)] += step
        return Belief(belief.mean, covariance)

    def strain(self, belief: Belief, anchors: Mapping[str, Floats]) -> float:
        """Chi-squared of the offsets as they are estimated, against the covariances (2, 2) px^2 that they may have.

        What the cameras show differs from one thing by that; redundancy 2 for each camera, minus the dimensions.
        """
        names = tuple(anchors)
        at: Integers = np.concatenate([self._offset(name) for name in names])
        allowed = self.views.shared(names, self.place(belief))
        for i, anchor in enumerate(anchors.values()):
            allowed[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += anchor + UNSTEADY
        offsets = belief.mean[at]
        return float(offsets @ np.linalg.solve(allowed, offsets))

    def _offset(self, name: str) -> Integers:
        first = self._moving + 2 * self.views.names.index(name)
        return np.array((first, first + 1))

    def _linearised(self, mean: Floats, name: str, with_offset: bool) -> tuple[Floats, Floats]:
        """Image point (2,) and its derivatives (2, states)."""
        d, late = self._d, self._late[name]
        xy, by_place = self.views.project(name, mean[:d] + late * mean[d : 2 * d])
        rows = np.zeros((2, self._size))
        rows[:, :d], rows[:, d : 2 * d] = by_place, late * by_place
        if with_offset:
            at = self._offset(name)
            xy, rows[:, at] = xy + mean[at], np.eye(2)
        return xy, rows


def mark_observation(xy: Floats, shift: Floats) -> Observation:
    """A mark as it is, against an offset that was anchored at it, in an image that is off by so much, px."""
    return Observation(xy, _TINY**2 * np.eye(2), shift)
