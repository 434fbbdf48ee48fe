"""Quantities that change with time, given by a few keyframes.

The curve through them is the piecewise cubic Hermite interpolant with Fritsch-Butland slopes: it never overshoots its
keyframes, has a continuous derivative and stays constant before the first and after the last one.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

Keyframe = tuple[float, float]  #: time in s, value


@dataclass(frozen=True, slots=True)
class Curve:
    """A smooth curve through keyframes with ascending times.

    Attributes:
        times: s, strictly ascending.
        values: in the unit of the quantity.
        slopes: unit of the quantity per s, at each keyframe.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    slopes: tuple[float, ...]

    @classmethod
    def through(cls, keyframes: Sequence[Keyframe]) -> "Curve":
        """The curve through `keyframes`."""
        times = tuple(time for time, _ in keyframes)
        values = tuple(value for _, value in keyframes)
        secants = [(v1 - v0) / (t1 - t0) for (t0, v0), (t1, v1) in pairwise(keyframes)]
        inner = [2 * left * right / (left + right) if left * right > 0 else 0.0 for left, right in pairwise(secants)]
        ends = [0.0] if secants else []
        return cls(times, values, (0.0, *inner, *ends))

    def __call__(self, time_s: float) -> float:
        """Value at `time_s`."""
        if time_s <= self.times[0]:
            return self.values[0]
        if time_s >= self.times[-1]:
            return self.values[-1]
        i = bisect_right(self.times, time_s) - 1
        step = self.times[i + 1] - self.times[i]
        u = (time_s - self.times[i]) / step
        rise = self.values[i + 1] - self.values[i]
        first, last = self.slopes[i] * step, self.slopes[i + 1] * step
        cubic, square = first + last - 2 * rise, 3 * rise - 2 * first - last
        return self.values[i] + u * (first + u * (square + u * cubic))
