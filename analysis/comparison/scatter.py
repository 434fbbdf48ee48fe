"""The athlete's own scatter: how much jumps differ that nobody meant to be different."""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtr

from analysis.comparison.aligned import MeasuredJump, series
from rig.arrays import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """How jumps scatter about the mean of their group.

    Two jumps are compared by that of further ones, so that it is independent of their difference.

    Attributes:
        deviation: (11, T) standard deviation of one jump, with its errors of measurement; NaN where it is not known.
        jumps: how many there are.
        freedom: degrees of freedom: jumps less groups.
    """

    deviation: Floats
    jumps: int
    freedom: int

    def p(self, difference: Floats, sigma: Floats | None = None) -> Floats:
        """Probability (11, T) of such a difference by chance, one quantity at one time.

        Args:
            difference: (11, T) of two jumps, or of the means of two groups.
            sigma: (11, T) standard deviation of the latter, as far as this scatter tells it; None: of two jumps.
        """
        sigma = np.sqrt(2) * self.deviation if sigma is None else sigma
        return np.asarray(2 * stdtr(self.freedom, -np.abs(difference) / sigma))


def scatter(others: list[MeasuredJump], times: Floats) -> Scatter | None:
    """The scatter of jumps about the mean of each athlete; None if no athlete has two of them.

    Args:
        others: jumps that are not compared; without an athlete's name those of one recording belong together.
        times: since the take-off, (T,) s.
    """
    groups: dict[str, list[Floats]] = defaultdict(list)
    for jump in others:
        groups[jump.athlete or jump.recording.recording].append(series(jump, times).values)
    return scatter_within(list(groups.values()))


def scatter_within(groups: list[list[Floats]]) -> Scatter | None:
    """The scatter of jumps, each given by its values (11, T), about the means of groups; None if no group has two."""
    stacks = [np.stack(values) for values in groups if len(values) > 1]
    if not stacks:
        return None
    jumps = sum(len(stack) for stack in stacks)
    freedom = jumps - len(stacks)
    squares = sum(((stack - stack.mean(axis=0)) ** 2).sum(axis=0) for stack in stacks)
    return Scatter(np.sqrt(np.asarray(squares) / freedom), jumps, freedom)
