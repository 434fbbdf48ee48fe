"""Traces as measurements of lines in space: what a trace says about a ski whose line is known roughly.

A ski is a point A on it, near the binding, and a direction d. Projected, it is nearly linear in both: from some 40 m,
3 m of ski have little perspective. So a trace gives two linear equations, the distances of its two ends from the line.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.candidates.model import Trace
from analysis.identification.views import Views, gate
from rig.arrays import Flags, Floats

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
class Equations:
    """What a trace says about a ski.

    Attributes:
        off: (2,) px, how far the ski lies from its ends, across the trace.
        by_ski: (2, 6) derivatives by A and d.
        aside: (2,) px, the same across the ski; right also for a trace that runs across the ski.
        by_ski_aside: (2, 6) derivatives by A and d.
        covariance: (2, 2) px^2, of the ends.
        along: (2,) m, where along the ski its ends are, from A.
    """

    off: Floats
    by_ski: Floats
    aside: Floats
    by_ski_aside: Floats
    covariance: Floats
    along: Floats

    def near(self, spread: Floats) -> bool:
        """Whether the trace lies within the uncertainty of the ski."""
        total = self.by_ski_aside @ spread @ self.by_ski_aside.T + self.covariance
        total = total + np.diag((_PERSPECTIVE * self.aside) ** 2)
        return bool(self.aside @ np.linalg.solve(total, self.aside) < gate(2))

    def misfit(self, state: Floats, spread: Floats) -> tuple[float, float]:
        """Chi-square for a ski that differs by `state` (6,), and the logarithm of its covariance's determinant."""
        total = self.by_ski @ spread @ self.by_ski.T + self.covariance
        (a, b), (_, d) = total
        x, y = self.off - self.by_ski @ state
        determinant = a * d - b * b
        return float((d * x * x - 2 * b * x * y + a * y * y) / determinant), float(np.log(determinant))

    def updated(self, state: Floats, spread: Floats) -> tuple[Floats, Floats]:
        """The ski with what the trace says."""
        gain = spread @ self.by_ski.T @ np.linalg.inv(self.by_ski @ spread @ self.by_ski.T + self.covariance)
        return state + gain @ (self.off - self.by_ski @ state), spread - gain @ self.by_ski @ spread


class SeenSkis:
    """n skis in one camera: what traces say about them.

    Attributes:
        inside: (n,) whether the ski's middle lies in the image.
    """

    def __init__(self, views: Views, k: int, values: Floats) -> None:
        place, direction = values[:, :3], values[:, 3:]
        low, high = (views.see(k, place + s * direction) for s in (-_HALF_M, _HALF_M))
        self._xy = np.stack((low.xy, high.xy), axis=1)
        self._by_point = np.stack((low.by_point, high.by_point), axis=1)
        self._pose = (low.pose + high.pose) / 2
        self.inside: Flags = views.see(k, place).inside

    def equations(self, i: int, line: StraightTrace) -> Equations:
        """What a trace says about ski i."""
        low, high = self._xy[i]
        axis = high - low
        share = (line.ends - low) @ axis / (axis @ axis)
        along = _HALF_M * (2 * share - 1)
        by_point = np.multiply.outer(1 - share, self._by_point[i, 0]) + np.multiply.outer(share, self._by_point[i, 1])
        by_ski = np.concatenate((by_point, along[:, None, None] * by_point), axis=2)
        normal = np.array((-axis[1], axis[0])) / np.linalg.norm(axis)
        deviation = (line.ends - low) @ normal
        covariance = line.covariance + normal @ self._pose[i] @ normal
        off = (line.ends - low - share[:, None] * axis) @ line.normal
        return Equations(off, line.normal @ by_ski, deviation, normal @ by_ski, covariance, along)
