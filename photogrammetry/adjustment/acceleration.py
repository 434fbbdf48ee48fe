"""Faster arrival where Gauss-Newton creeps or overshoots: large residuals, weak geometry.

Successive Gauss-Newton steps shrink by nearly constant factors along a few directions. What the last steps tell of
these directions is used to jump where they would end (Anderson's extrapolation). Only a proposal: whoever uses it
checks it.
"""

import numpy as np

from photogrammetry.adjustment.normals import Normals
from photogrammetry.adjustment.state import Floats

_MEMORY = 4
_LONGEST = 4.0  # times the Gauss-Newton step, in terms of what it does to the residuals


class Acceleration:
    """Remembers the last steps; unknowns (u,), unscaled."""

    def __init__(self) -> None:
        self._steps: list[Floats] = []
        self._moves: list[Floats] = []

    def forget(self) -> None:
        """Start over: the last move was none of ours."""
        self._steps, self._moves = [], []

    def record(self, step: Floats, move: Floats) -> None:
        """Remember a Gauss-Newton step and the move that was made in its place."""
        self._steps = [*self._steps, step][-_MEMORY:]
        self._moves = [*self._moves, move][-_MEMORY:]

    def propose(self, normals: Normals, step: Floats) -> Floats | None:
        """A better move than `step`, judged by the last ones; None where they say nothing."""
        if not self._steps:
            return None
        changes = np.diff(np.array([*self._steps, step]), axis=0).T
        scaled = changes / normals.scale[:, None]
        # in the metric of the residuals: what an unknown does counts, not its unit
        felt = normals.times(scaled)
        weights, *_ = np.linalg.lstsq(scaled.T @ felt, felt.T @ (step / normals.scale), rcond=1e-10)
        proposal: Floats = step - (np.array(self._moves).T + changes) @ weights
        if _size(normals, proposal) > _LONGEST * _size(normals, step):
            return None
        return proposal


def _size(normals: Normals, step: Floats) -> float:
    scaled = (step / normals.scale)[:, None]
    return float(np.sqrt(max(0.0, float(np.vdot(scaled, normals.times(scaled))))))
