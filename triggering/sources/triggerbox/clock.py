"""Puts the pulses of a trigger box on the host's clock, from questions how far the box has counted.

The box reads its timer at some time between question and answer. Short round trips tell that time best: a line through
first, between the counts (in pulses, with their fraction) and the middles of these.
"""

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.clocks import HostNs

#: Questions that are kept; at ten per second those of the last ten seconds, over which no crystal wanders.
_KEPT: Final = 100
#: The line goes through the shortest round trips: this share of them, and at least so many.
_BEST_SHARE: Final = 0.25
_READINGS_LEAST: Final = 8
#: Largest error of the box's clock: the ceramic resonator of an Arduino keeps 0.5 %.
_CRYSTAL: Final = 0.005
#: So many counts in a row that contradict the line show that the box's count or its clock was set.
_CONTRADICTED: Final = 3


@dataclass(frozen=True, slots=True)
class Reading:
    """One question and its answer.

    Attributes:
        asked, answered: host times between which the box read its timer.
        phase: how far it had counted, in pulses: 7.25 is a quarter of a period after the edge of pulse 7 rose.
    """

    asked: HostNs
    answered: HostNs
    phase: float

    @property
    def middle(self) -> float:
        """The time half way, ns."""
        return (self.asked + self.answered) / 2

    @property
    def half_ns(self) -> float:
        """Largest error of the middle, ns."""
        return (self.answered - self.asked) / 2


@dataclass(frozen=True, slots=True)
class ClockLine:
    """Host time of a pulse by its number: `offset + gain * number`.

    Attributes:
        number: pulse in the middle of the questions, to which `time` belongs.
        time: host time of that pulse, ns.
        gain_ns: time between two pulses, ns.
        residual_ns: largest distance of a question that was used from the line, ns.
        uncertainty_ns: largest error of the times at the last question, ns: half of the longest round trip that was
            used, and what the error of the gain has added since.
        readings: questions that were used.
    """

    number: float
    time: float
    gain_ns: float
    residual_ns: float
    uncertainty_ns: float
    readings: int

    def at(self, number: float) -> HostNs:
        """Host time at which the edge of a pulse rose."""
        return HostNs(round(self.time + (number - self.number) * self.gain_ns))


class BoxClock:
    """The line of one train of pulses.

    Args:
        period_ns: nominal time between two pulses.

    Attributes:
        line: the present line; None until enough questions have been answered.
        contradicted: readings in a row that do not lie on it.
    """

    def __init__(self, period_ns: float) -> None:
        self._period_ns = period_ns
        self._readings: deque[Reading] = deque(maxlen=_KEPT)
        self.line: ClockLine | None = None
        self.contradicted = 0

    @property
    def broken(self) -> bool:
        """Whether the box's count or clock was set: the line no longer holds, and a new one is to be begun."""
        return self.contradicted >= _CONTRADICTED

    def add(self, reading: Reading) -> bool:
        """Enter a reading.

        Returns:
            Whether it agrees with the readings before; otherwise it is left out.
        """
        if not self._agrees(reading):
            self.contradicted += 1
            return False
        self.contradicted = 0
        self._readings.append(reading)
        if len(self._readings) >= _READINGS_LEAST:
            self.line = self._fit()
        return True

    def _agrees(self, reading: Reading) -> bool:
        """Whether a reading is possible after the last one, and near the line."""
        if not self._readings:
            return True
        last = self._readings[-1]
        least, most = reading.asked - last.answered, reading.answered - last.asked
        gone = (reading.phase - last.phase) * self._period_ns
        if not least * (1 - _CRYSTAL) <= gone <= most * (1 + _CRYSTAL):
            return False
        if self.line is None:
            return True
        slack = reading.half_ns + self.line.uncertainty_ns + _CRYSTAL * (reading.asked - last.asked)
        return abs(self.line.at(reading.phase) - reading.middle) <= slack

    def _fit(self) -> ClockLine:
        """Least squares, weighted by the round trips."""
        best = sorted(self._readings, key=lambda reading: reading.half_ns)
        best = best[: max(_READINGS_LEAST, round(_BEST_SHARE * len(best)))]
        half = np.array([reading.half_ns for reading in best])
        phase = np.array([reading.phase for reading in best])
        first = best[0].middle
        middle = np.array([reading.middle - first for reading in best])
        weight = 1 / np.maximum(half, 1.0) ** 2
        number, time = float(np.average(phase, weights=weight)), float(np.average(middle, weights=weight))
        x, y = phase - number, middle - time
        # A short train says little of the gain: what the crystal may be off is a bound from the data sheet.
        gain = float((weight * x) @ y / max((weight * x) @ x, np.finfo(float).tiny))
        limits = self._period_ns / (1 + _CRYSTAL), self._period_ns / (1 - _CRYSTAL)
        gain = min(max(gain, limits[0]), limits[1])
        residual = float(np.abs(y - gain * x).max())
        return ClockLine(number, first + time, gain, residual, self._bound(half, middle, first + time), len(best))

    def _bound(self, half: NDArray[np.float64], middle: NDArray[np.float64], centre: float) -> float:
        """Largest error of the line at the last question, ns: where it was put, and what its slope adds since then.

        Args:
            half: largest errors of the readings, shape (n,), ns.
            middle: their times, shape (n,), ns.
            centre: host time of their centre, ns.
        """
        longest, span = float(half.max()), float(np.ptp(middle))
        slope = min(2 * longest / max(span, 1.0), 2 * _CRYSTAL)
        return longest + slope * abs(self._readings[-1].middle - centre)
