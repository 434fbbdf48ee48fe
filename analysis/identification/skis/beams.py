"""Hypotheses about which traces show which ski, built camera by camera; only the best are followed further."""

from dataclasses import dataclass

import numpy as np

from analysis.identification.over_time.assignment import DECISIVE, MOST_OPTIONS, Option, nothing
from analysis.identification.skis.ski_traces import Equations
from analysis.identification.space.views import gate
from rig.arrays import Floats, Integers

_BEAM = 12


@dataclass(frozen=True, slots=True, eq=False)
class Beams:
    """Hypotheses about the traces of each ski, those of one ski one after the other, the best first.

    Attributes:
        ski: (h,) number of the ski, ascending.
        cost: (h,) as in `assignment`.
        rays: (h, m) index of the trace in each image; -1: none.
        state: (h, 6) by how much the ski differs from what was believed.
        spread: (h, 6, 6) of it.
    """

    ski: Integers
    cost: Floats
    rays: Integers
    state: Floats
    spread: Floats

    @classmethod
    def begun(cls, skis: Integers, spread: Floats, m: int) -> "Beams":
        """Skis of which nothing is found yet in m images; spread (n, 6, 6) of all skis."""
        n = len(skis)
        return cls(skis, np.zeros(n), np.full((n, m), -1), np.zeros((n, 6)), spread[skis])

    def longer(self, k: int, skis: Integers, traces: Integers, equations: Equations, extra: Floats) -> "Beams":
        """The best hypotheses with and without a trace of camera k.

        Args:
            k: number of the camera.
            skis: (n,) skis that traces may show.
            traces: (n,) index of the trace.
            equations: of these n pairs.
            extra: (n,) their costs but for how they fit.
        """
        first, last = np.searchsorted(self.ski, skis), np.searchsorted(self.ski, skis, side="right")
        pair = np.repeat(np.arange(len(skis)), last - first)
        came = np.arange(len(pair)) - np.repeat(np.cumsum(last - first) - last, last - first)
        misfit, area = equations.only(pair).misfit(self.state[came], self.spread[came])
        fits = misfit < gate(2)
        pair, came = pair[fits], came[fits]
        cost = self.cost[came] + misfit[fits] + extra[pair] + area[fits]
        rays = self.rays[came]
        rays[:, k] = traces[pair]
        state, spread = equations.only(pair).updated(self.state[came], self.spread[came])
        return Beams(
            np.concatenate((self.ski, skis[pair])),
            np.concatenate((self.cost, cost)),
            np.concatenate((self.rays, rays)),
            np.concatenate((self.state, state)),
            np.concatenate((self.spread, spread)),
        )._best()

    def _best(self) -> "Beams":
        """The best hypotheses of each ski."""
        order = np.lexsort((self.cost, self.ski))
        ski = self.ski[order]
        order = order[np.arange(len(ski)) - np.searchsorted(ski, ski) < _BEAM]
        return Beams(self.ski[order], self.cost[order], self.rays[order], self.state[order], self.spread[order])

    def options(self, ski: int) -> list[Option]:
        """Options of one ski, the best first: nothing, and what chance does not explain."""
        first, last = np.searchsorted(self.ski, (ski, ski + 1)).tolist()
        found = [Option(float(self.cost[i]), self.rays[i], 0) for i in range(first, last) if self.cost[i] < -DECISIVE]
        return [nothing(self.rays.shape[1]), *found[: 2 * MOST_OPTIONS]]
