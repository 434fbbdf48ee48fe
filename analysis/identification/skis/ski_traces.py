"""Traces as measurements of lines in space: what a trace says about a ski whose line is known roughly.

A ski is a point A on it, near the binding, and a direction d. Projected, it is nearly linear in both: from some 40 m,
3 m of ski have little perspective. So a trace gives two linear equations, the distances of its two ends from the line.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.candidates.model import Trace
from analysis.identification.space.views import Sight, gate
from rig.arrays import Flags, Floats, Integers

_PERSPECTIVE = 0.05  #: share of a distance across the ski that neglects the perspective of 3 m
_HALF_M = 1.2  #: points so far from A carry the projected line; about half a ski


@dataclass(frozen=True, slots=True, eq=False)
class StraightTrace:
    """A straight line through the points of one trace, or of several that are parts of one line.

    Attributes:
        parts: indices of the traces.
        ends: (2, 2) px, the ends on the fitted line.
        normal: (2,) unit vector across it.
        covariance: (2, 2) px^2, of the two ends across the line.
    """

    parts: tuple[int, ...]
    ends: Floats
    normal: Floats
    covariance: Floats


def straightened(traces: Sequence[Trace], shift: Floats) -> list[StraightTrace]:
    """The traces of an image, moved by `shift` (2,), as straight lines; those that continue each other become one."""
    lines = [_fit(traces, (i,)) for i in range(len(traces)) if len(traces[i].xy) > 1]
    while True:
        joins = [
            (misfit, a, b)
            for a in range(len(lines))
            for b in range(a + 1, len(lines))
            if (misfit := _break(lines[a], lines[b])) < gate(2)
        ]
        if not joins:
            return [replace(line, ends=line.ends + shift) for line in lines]
        _, a, b = min(joins)
        joined = _fit(traces, lines[a].parts + lines[b].parts)
        lines = [line for i, line in enumerate(lines) if i not in {a, b}] + [joined]


def _fit(traces: Sequence[Trace], parts: tuple[int, ...]) -> StraightTrace:
    xy = np.concatenate([traces[i].xy for i in parts])
    weight = 1 / np.concatenate([traces[i].sigma for i in parts]) ** 2
    centre = weight @ xy / weight.sum()
    off = xy - centre
    axis = np.linalg.eigh((off * weight[:, None]).T @ off)[1][:, 1]
    normal = np.array((-axis[1], axis[0]))
    along = off @ axis
    reach = np.array((along.min(), along.max()))
    common = max(traces[i].common for i in parts) ** 2
    covariance = (1 / weight.sum() + common) + np.outer(reach, reach) / (weight @ along**2)
    return StraightTrace(parts, centre + reach[:, None] * axis, normal, covariance)


def _break(one: StraightTrace, other: StraightTrace) -> float:
    """Chi-square (2 degrees of freedom) of one line being the other's continuation; infinite where they overlap."""
    axis = one.ends[1] - one.ends[0]
    length = float(np.linalg.norm(axis))
    along = (other.ends - one.ends[0]) @ axis / length
    gap = max(along.min() - length, -along.max())
    if gap < -0.1 * length or gap > length + np.ptp(along):
        return np.inf
    # Distances of the other's ends from this line, with the covariance of both.
    weights = np.stack((1 - along / length, along / length), axis=1)
    off = (other.ends - one.ends[0]) @ one.normal
    covariance = weights @ one.covariance @ weights.T + other.covariance
    return float(off @ np.linalg.solve(covariance, off))


@dataclass(frozen=True, slots=True, eq=False)
class Lines:
    """The straight traces of one camera at all pulses.

    Attributes:
        step: (n,) index of the pulse; ascending.
        place: (n,) index among those of the pulse.
        ends: (n, 2, 2) px.
        normal: (n, 2).
        covariance: (n, 2, 2) px^2, as in `StraightTrace`.
    """

    step: Integers
    place: Integers
    ends: Floats
    normal: Floats
    covariance: Floats

    @classmethod
    def of(cls, traces: Sequence[Sequence[StraightTrace]]) -> "Lines":
        """The traces of each pulse."""
        lines = [line for of_pulse in traces for line in of_pulse]
        return cls(
            np.repeat(np.arange(len(traces)), [len(of_pulse) for of_pulse in traces]),
            np.array([i for of_pulse in traces for i in range(len(of_pulse))], int),
            np.array([line.ends for line in lines]).reshape(-1, 2, 2),
            np.array([line.normal for line in lines]).reshape(-1, 2),
            np.array([line.covariance for line in lines]).reshape(-1, 2, 2),
        )

    def only(self, chosen: Integers) -> "Lines":
        """Some of them, which may repeat."""
        return Lines(
            self.step[chosen], self.place[chosen], self.ends[chosen], self.normal[chosen], self.covariance[chosen]
        )

    def at(self, step: Integers, place: Integers) -> "Lines":
        """Those with these places among the traces of these pulses."""
        return self.only(np.searchsorted(self.step, step) + place)


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """What n traces say about a ski each.

    Attributes:
        off: (n, 2) px, how far the ski lies from the ends of its trace, across the trace.
        by_ski: (n, 2, 6) derivatives by A and d.
        aside: (n, 2) px, the same across the ski; right also for a trace that runs across the ski.
        by_ski_aside: (n, 2, 6) derivatives by A and d.
        covariance: (n, 2, 2) px^2, of the ends.
        along: (n, 2) m, where along the ski the ends are, from A.
    """

    off: Floats
    by_ski: Floats
    aside: Floats
    by_ski_aside: Floats
    covariance: Floats
    along: Floats

    def only(self, chosen: Integers) -> "Equations":
        """Some of them, which may repeat."""
        return Equations(
            self.off[chosen],
            self.by_ski[chosen],
            self.aside[chosen],
            self.by_ski_aside[chosen],
            self.covariance[chosen],
            self.along[chosen],
        )

    def near(self, spread: Floats) -> Flags:
        """Whether each trace lies within the uncertainty (n, 6, 6) of its ski."""
        total = self.by_ski_aside @ spread @ self.by_ski_aside.swapaxes(1, 2) + self.covariance
        total += ((_PERSPECTIVE * self.aside) ** 2)[:, None] * np.eye(2)
        return np.asarray(_squares(total, self.aside)[0] < gate(2))

    def misfit(self, state: Floats, spread: Floats) -> tuple[Floats, Floats]:
        """Chi-squares (n,) for skis that differ by `state` (n, 6), and log determinants of their covariances."""
        total = self.by_ski @ spread @ self.by_ski.swapaxes(1, 2) + self.covariance
        squares, determinant = _squares(total, self._left(state))
        return squares, np.asarray(np.log(determinant))

    def updated(self, state: Floats, spread: Floats) -> tuple[Floats, Floats]:
        """The skis (n, 6) and (n, 6, 6) with what the traces say."""
        turned = spread @ self.by_ski.swapaxes(1, 2)
        gain = turned @ np.linalg.inv(self.by_ski @ turned + self.covariance)
        return state + (gain @ self._left(state)[..., None])[..., 0], spread - gain @ self.by_ski @ spread

    def _left(self, state: Floats) -> Floats:
        """What is left (n, 2) of the distances."""
        return np.asarray(self.off - (self.by_ski @ state[..., None])[..., 0])


def _squares(covariance: Floats, off: Floats) -> tuple[Floats, Floats]:
    """Chi-squares (n,) of deviations (n, 2) with covariances (n, 2, 2), and the determinants of these."""
    a, b, d = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    x, y = off.T
    determinant = a * d - b * b
    return (d * x * x - 2 * b * x * y + a * y * y) / determinant, determinant


class SeenSkis:
    """Skis in one camera: what traces say about them.

    Attributes:
        inside: (s,) whether the ski's middle lies in the image.
    """

    def __init__(self, sight: Sight) -> None:
        """Skis by how the camera sees their `places`."""
        s = len(sight.xy) // 3
        ends = sight.only(slice(2 * s))
        self._xy = ends.xy.reshape(2, -1, 2).swapaxes(0, 1)
        self._by_point = ends.by_point.reshape(2, -1, 2, 3).swapaxes(0, 1)
        self._pose = ends.pose.reshape(2, -1, 2, 2).mean(axis=0)
        self.inside: Flags = sight.inside[2 * s :]

    @staticmethod
    def places(values: Floats) -> Floats:
        """Object points (3 s, 3) that a camera must be asked for: both ends and the middles of skis (s, 6)."""
        place, half = values[:, :3], _HALF_M * values[:, 3:]
        return np.concatenate((place - half, place + half, place))

    def equations(self, skis: Integers, lines: Lines) -> Equations:
        """What n traces say about a ski (n,) each."""
        low, high = self._xy[skis].swapaxes(0, 1)
        axis = high - low
        from_low = lines.ends - low[:, None]
        share = (from_low @ axis[..., None])[..., 0] / (axis**2).sum(axis=1, keepdims=True)
        along = _HALF_M * (2 * share - 1)
        one, other = self._by_point[skis].swapaxes(0, 1)[:, :, None]
        by_point = (1 - share)[..., None, None] * one + share[..., None, None] * other
        by_ski = np.concatenate((by_point, along[..., None, None] * by_point), axis=3)
        normal = np.stack((-axis[:, 1], axis[:, 0]), axis=1) / np.linalg.norm(axis, axis=1, keepdims=True)
        pose = np.einsum("ni,nij,nj->n", normal, self._pose[skis], normal)
        return Equations(
            ((from_low - share[..., None] * axis[:, None]) @ lines.normal[..., None])[..., 0],
            np.einsum("ni,neij->nej", lines.normal, by_ski),
            (from_low @ normal[..., None])[..., 0],
            np.einsum("ni,neij->nej", normal, by_ski),
            lines.covariance + pose[:, None, None],
            along,
        )
