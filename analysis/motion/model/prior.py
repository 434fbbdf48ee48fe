"""The prior of the motion: white noise on the jerk of each channel, of three regimes, with a break at the take-off.

On the table, around the edge and in flight the channels move differently, so each regime has its own density q of the
jerk's noise, and at the take-off the acceleration may break. A push does not end at a known moment: what the edge adds
to the flight fades. The densities are not given: they are variance components, estimated from the jump itself together
with everything else. Their start values are sizes of human movement, known by their order of magnitude: the square root
of each density has a half-Cauchy prior, with the start value as its median.

A state is (value, h velocity, h^2/2 acceleration) of all channels, with the pulse interval h as unit of time.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.motion.model.channels import CHANNELS, ORIGIN, START_MEAN, START_SIGMA
from analysis.result.model import EDGE_S
from rig.arrays import Floats, Integers

STATE: Final = 3 * CHANNELS
REGIMES: Final = ("table", "edge", "flight")
#: Channels that share a density: O along, across, up; body in the plane of the flight and across it; the distance of
#: the bindings; slope and opening of the skis; their difference of slope and their heading.
SHARE: Final = np.array((0, 1, 2, 3, 4, 3, 3, 4, 3, 5, 5, 5, 6, 7, 7, 6))
_SHARES: Final = 8
#: Accelerations (m/s^2, rad/s^2) that a channel may gain within `_WITHIN_S`, by regime and share. On the table the
#: track guides the skis; at the edge a jumper pushes with a few g; in flight he corrects.
_GAIN: Final = np.array(
    ((0.5, 0.5, 0.5, 10, 5, 2, 0.5, 0.5), (20, 5, 20, 20, 10, 10, 20, 20), (1, 1, 1, 5, 3, 3, 5, 5)), float
)
_WITHIN_S: Final = 0.1
_FADE_S: Final = EDGE_S / 2  #: in so long a time the density of the edge falls to 1 / e: at the end of the phase, 14 %
_BREAK: Final = np.array((20, 10, 40, 20, 10, 10, 20, 20), float)[SHARE]  # m/s^2, rad/s^2: at the take-off
_BODY_S: Final = 1.0
_ALL: Final = np.arange(CHANNELS)
_NODES: Final = np.polynomial.legendre.leggauss(12)  # of an integral from -1 to 1: places and weights
_SMALLEST: Final = 1e-4  # of the start value: below, a density is as good as none


def start_densities() -> Floats:
    """(3, 8) densities q by regime and share, m^2/s^5 and rad^2/s^5."""
    return np.asarray(_GAIN**2 / _WITHIN_S)


#: Density of the jerk's noise of the liveliest part of a jumper, at the edge, m^2/s^5.
LIVELIEST: Final = float(start_densities().max())


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """The motion between n pulses; of g possible times of the take-off, see `prior`.

    Attributes:
        unit: h, s.
        transition: (n - 1, 3, 3) of a channel's state.
        by_density: (..., n - 1, 3, 3, 3) covariance that density 1 of each regime adds (of the edge, at the take-off).
        by_break: (..., n - 1, 3, 3) covariance that a break of variance 1 adds.
        density: (3, 8) by regime and share.
    """

    unit: float
    transition: Floats
    by_density: Floats
    by_break: Floats
    density: Floats

    def noise(self, channels: Integers = _ALL) -> Floats:
        """(..., n - 1, c, 3, 3) covariance that the state of each channel gains between two pulses."""
        jerk = np.einsum("...krij,rc->...kcij", self.by_density, self.density[:, SHARE[channels]])
        return np.asarray(jerk + np.einsum("...kij,c->...kcij", self.by_break, _BREAK[channels] ** 2))

    def with_density(self, density: Floats) -> "Prior":
        """The same with other densities."""
        return Prior(self.unit, self.transition, self.by_density, self.by_break, density)

    def start(self) -> tuple[Floats, Floats]:
        """Mean and weight (48,) of the first pulse's state."""
        scale = np.array((1.0, self.unit, self.unit**2 / 2))
        mean = np.concatenate((START_MEAN, np.zeros(2 * CHANNELS)))
        return mean, (START_SIGMA * scale[:, None]).ravel() ** -2.0

    def body(self) -> Floats:
        """Weight (48,) with which the mean of `start` holds at each later pulse: a body stays together.

        It counts as one observation a second, so that it matters only where nothing was measured for long.
        """
        weight = self.start()[1].reshape(3, CHANNELS) * self.unit / _BODY_S
        weight[:, ORIGIN] = 0.0
        return weight.ravel()


def prior(
    times: Floats, unit: float, takeoff: float | Floats | None, density: Floats, airborne: float = -np.inf
) -> Prior:
    """The prior between pulses at `times` (n,), s, with the take-off at `takeoff`; (g,) for g possible times of it.

    From the take-off on there is the density of the flight, and on top of it that of the edge, which fades. Without a
    take-off everything from `airborne` on is flight; before, he may have passed the edge at any time.
    """
    start, end = times[:-1], times[1:]
    first = np.asarray(-np.inf if takeoff is None else takeoff)[..., None]
    last = np.full_like(first, airborne) if takeoff is None else first
    bounds = np.stack(np.broadcast_arrays(start, np.clip(first, start, end), np.clip(last, start, end), end))
    after = (end - bounds[1:]) / unit  # time left at the end of each regime's part
    by_density = np.moveaxis(_carried(white_jerk(np.diff(bounds, axis=0), unit), after), 0, -3)
    by_break = np.zeros(by_density[..., 0, :, :].shape)
    if takeoff is not None:
        by_density[..., 1, :, :] = _fading(start - first, end - first, unit)
        inside = (start < first) & (first <= end)
        gain = np.zeros((3, 3))
        gain[2, 2] = (unit**2 / 2) ** 2
        by_break[inside] = _carried(gain, after[0][inside])
    return Prior(unit, transitions((end - start) / unit), by_density, by_break, density)


def transitions(steps: Floats) -> Floats:
    """(..., 3, 3): a channel's state after steps (...), in units of time."""
    out = np.zeros((*steps.shape, 3, 3))
    out[..., range(3), range(3)] = 1.0
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = steps, steps**2, 2 * steps
    return out


def white_jerk(seconds: Floats, unit: float) -> Floats:
    """(..., 3, 3) covariance that white noise of density 1 on the jerk adds in so many seconds (...)."""
    powers = np.array(((20.0, 8.0, 6.0), (8.0, 3.0, 2.0), (6.0, 2.0, 1.0)))
    exponents = np.array(((5, 4, 3), (4, 3, 2), (3, 2, 1)))
    scale = np.array((1.0, unit, unit**2 / 2))
    return np.asarray(seconds[..., None, None] ** exponents / powers * np.outer(scale, scale))


def _fading(start: Floats, end: Floats, unit: float) -> Floats:
    """(..., 3, 3) what noise on the jerk adds between two times (...), s, if its density is exp(-t / T) from 0 on."""
    start = np.maximum(start, 0.0)
    # In long gaps the nodes stand where there is something to add.
    half = np.maximum(np.minimum(end, start + 20 * _FADE_S) - start, 0.0)[..., None] / 2
    places, weights = _NODES
    at = start[..., None] + half * (1 + places)
    left = (end[..., None] - at)[..., None]
    gain = np.concatenate((left**2 / 2, left, np.ones_like(left)), axis=-1) * (1.0, unit, unit**2 / 2)
    weighted = gain * (half * weights * np.exp(-at / _FADE_S))[..., None]
    return np.asarray(weighted.swapaxes(-1, -2) @ gain)


def _carried(covariance: Floats, steps: Floats) -> Floats:
    move = transitions(steps)
    return np.asarray(move @ covariance @ move.swapaxes(-1, -2))


def re_estimated(given: Prior, states: Floats, covariance: Floats, following: Floats) -> Floats:
    """Better densities (3, 8): variance components of the motion's own residuals.

    The residuals of an interval are w = x(k+1) - F x(k) with Q = sum q K and, as estimated, the covariance C_w. Each
    component gets its square sum over its redundancy: q <- q (w' Q^-1 K Q^-1 w) / (tr Q^-1 K - tr Q^-1 K Q^-1 C_w),
    as far as its prior lets it (`_shared`).

    Args:
        given: the prior that the solution was computed with.
        states: (n, 48).
        covariance: (n, 48, 48) of the states.
        following: (n - 1, 48, 48) of the states of pulses k and k + 1.
    """
    n = len(states)
    x = states.reshape(n, 3, CHANNELS).transpose(0, 2, 1)
    w = x[1:] - np.einsum("kij,kcj->kci", given.transition, x[:-1])
    own, mixed = _by_channel(covariance), _by_channel(following)
    f = given.transition[:, None]
    moved = f @ mixed
    of_w = own[1:] - moved - moved.swapaxes(-1, -2) + f @ own[:-1] @ f.swapaxes(-1, -2)
    weight = np.linalg.inv(given.noise())
    pull = np.einsum("kcij,kcj->kci", weight, w)
    middle = weight - weight @ of_w @ weight
    squares = np.einsum("kci,krij,kcj->rc", pull, given.by_density, pull)
    redundancy = np.einsum("kcij,krji->rc", middle, given.by_density)
    start = start_densities()
    return _shared(given.density, squares, redundancy, start)


def _shared(density: Floats, squares: Floats, redundancy: Floats, start: Floats) -> Floats:
    """New densities (3, 8) from square sums and redundancies (3, 16) per unit of density.

    With the square sum S and the redundancy r of a density q, the derivative of the likelihood's logarithm by that of
    sqrt(q) is S / q - r; that of a half-Cauchy prior with median sqrt(q0) is 1 - 2 q / (q + q0). The densities, most
    likely on a logarithmic scale, are where both together are 0. A few pseudo-observations of q0 instead (an inverse
    gamma prior) would keep q from being much smaller than q0 however still the jumper is (Gelman 2006, Bayesian
    Analysis 1, section 4).
    """
    groups = np.eye(_SHARES)[SHARE]
    square = (squares @ groups) * density**2
    count = np.maximum(redundancy @ groups, 0.0) * density
    better = (square + density) / (count + 2 * density / (density + start))
    return np.asarray(np.maximum(better, _SMALLEST * start))


def _by_channel(covariance: Floats) -> Floats:
    """(n, 16, 3, 3) diagonal blocks of each channel from (n, 48, 48)."""
    n = len(covariance)
    split = covariance.reshape(n, 3, CHANNELS, 3, CHANNELS)
    return np.asarray(np.einsum("nicjc->ncij", split))
