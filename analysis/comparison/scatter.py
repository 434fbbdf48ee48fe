"""The athlete's own scatter: how much jumps differ that nobody meant to be different."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr

from analysis.comparison.aligned import MeasuredJump, series
from rig.arrays import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """Of further jumps; the two that are compared are not among them, so that it is independent of their difference.

    Attributes:
        deviation: (11, T) standard deviation of one jump, with its errors of measurement; NaN where it is not known.
        jumps: how many there are.
        freedom: degrees of freedom: jumps less athletes.
    """

    deviation: Floats
    jumps: int
    freedom: int

    def p(self, difference: Floats) -> Floats:
        """Probability that two jumps of one athlete differ as much (11, T), one quantity at one time."""
        return np.asarray(2 * stdtr(self.freedom, -np.abs(difference) / (np.sqrt(2) * self.deviation)))


def scatter(others: list[MeasuredJump], times: Floats) -> Scatter | None:
    """The scatter of jumps about the mean of each athlete; None if no athlete has two of them.

    Args:
        others: jumps that are not compared; without an athlete's name those of one recording belong together.
        times: since the take-off, (T,) s.
    """
    groups: dict[str, list[Floats]] = defaultdict(list)
    for jump in others:
        groups[jump.athlete or jump.recording.recording].append(series(jump, times).values)
    stacks = [np.stack(values) for values in groups.values() if len(values) > 1]
    if not stacks:
        return None
    jumps = sum(len(stack) for stack in stacks)
    freedom = jumps - len(stacks)
    squares = sum(((stack - stack.mean(axis=0)) ** 2).sum(axis=0) for stack in stacks)
    return Scatter(np.sqrt(np.asarray(squares) / freedom), jumps, freedom)
