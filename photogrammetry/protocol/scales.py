"""Round numbers for scales, ticks and magnifications."""

import math


def nice(value: float) -> float:
    """The largest of 1, 2, 5, 10, 20, ... (and 0.5, 0.2, ...) that is not above a positive value."""
    power = 10.0 ** math.floor(math.log10(value))
    factor = next(f for f in (5.0, 2.0, 1.0) if f * power <= value * (1.0 + 1e-9))
    return float(f"{factor * power:.1g}")


def ticks(low: float, high: float, most: int) -> list[float]:
    """At most `most` round numbers within low..high, evenly spaced."""
    step = nice((high - low) / most)
    while (last := math.floor(high / step + 1e-9)) - (first := math.ceil(low / step - 1e-9)) >= most:
        step = nice(2.5 * step)
    return [round(k * step, 12) for k in range(first, last + 1)]


def rounded_up(value: float) -> float:
    """A positive value or a little more, so that an axis from 0 ends on a tick."""
    step = nice(value / 5.0)
    return math.ceil(value / step - 1e-9) * step
