"""Quantities of the jumper that change with time: a few keyframes in the scenario file, a smooth curve through them.

The curve is the piecewise cubic Hermite interpolant with Fritsch-Butland slopes: it never overshoots its keyframes, has
a continuous derivative, and is constant before the first and after the last keyframe.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

from pydantic import AfterValidator, Field

Keyframe = tuple[float, float]  #: time in s, value


def _ascending(keyframes: tuple[Keyframe, ...]) -> tuple[Keyframe, ...]:
    if any(late <= early for (early, _), (late, _) in pairwise(keyframes)):
        raise ValueError("times of keyframes must ascend: put them in order, each time once")
    return keyframes


#: Keyframes as a scenario file holds them.
Keyframes = Annotated[tuple[Keyframe, ...], Field(min_length=1), AfterValidator(_ascending)]


@dataclass(frozen=True, slots=True)
class Curve:
    """A smooth curve through keyframes.

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
        """The curve through `keyframes`, whose times ascend."""
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
