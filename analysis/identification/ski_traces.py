"""Traces as measurements of lines in space: what a trace says about a ski whose line is known roughly.

A ski is a point A on it, near the binding, and a direction d. Projected, it is nearly linear in both: from some 40 m,
3 m of ski have little perspective. So a trace gives two linear equations, the distances of its two ends from the line.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.candidates.model import Trace
from analysis.identification.views import Views, gate
from rig.arrays import Flags, Floats

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


def straightened(traces: Sequence[Trace]) -> list[StraightTrace]:
    """The traces of an image as straight lines; those that continue each other become one."""
    lines = [_fit(traces, (i,)) for i in range(len(traces)) if len(traces[i].xy) > 1]
    while True:
        joins = [
            (misfit, a, b)
            for a in range(len(lines))
            for b in range(a + 1, len(lines))
            if (misfit := _break(lines[a], lines[b])) < gate(2)
        ]
        if not joins:
            return lines
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

    def equations(self, i: int, line: StraightTrace) -> tuple[Floats, Floats, Floats]:
        """What a trace says about ski i.

        Returns:
            Distances (2,) of its ends from the ski, px; derivatives (2, 6) of the ski's distances by A and d; and the
            covariance (2, 2) of the ends, px^2.
        """
        low, high = self._xy[i]
        axis = high - low
        share = (line.ends - low) @ axis / (axis @ axis)
        off = (line.ends - low - share[:, None] * axis) @ line.normal
        by_low, by_high = line.normal @ self._by_point[i, 0], line.normal @ self._by_point[i, 1]
        by_place = np.outer(1 - share, by_low) + np.outer(share, by_high)
        along = _HALF_M * (2 * share - 1)
        by_ski = np.concatenate((by_place, along[:, None] * by_place), axis=1)
        pose = line.normal @ self._pose[i] @ line.normal
        return off, by_ski, line.covariance + pose
