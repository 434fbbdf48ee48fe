"""Tests the trigger times of a camera's frames by their arrivals: the time from a pulse to its frame hardly changes.

Three hypotheses compete: the frames came as usual; the link has become slow, and they come at any time; or their times
are off by a number of periods, and they came as usual after other pulses. The logarithms of the likelihood ratios
decide (Wald, Ann. Math. Stat. 16, 1945).
"""

import math
from collections import deque
from collections.abc import Sequence
from itertools import islice
from typing import Final, NamedTuple

from rig.clocks import HostNs
from triggering.timeline.pulse_train import PulseTrain

#: Share of a frame in the longest latency, which otherwise decays.
_DECAY: Final = 0.01
#: Median and scatter of the latencies are learned from so many, anew after each `_LEARN_EVERY`.
_RECENT: Final = 256
_LEARN_EVERY: Final = 16
#: The scatter of the latencies is known from so many frames on.
_KNOWN: Final = 64
#: A change of the latencies lasts if so many frames in a row show it.
LASTING: Final = 8
#: The median, and the quantile that lies one standard deviation below it: late frames are all above the median.
_QUANTILES: Final = (0.16, 0.5)
#: Least standard deviation of an arrival, ns: reading a clock and waking a process take so long.
_LEAST_NS: Final = 1e6
#: One arrival in a hundred says nothing, since the computer was busy. It lies anywhere within `_ANYWHERE_NS`.
_IDLE: Final = 0.01
_ANYWHERE_NS: Final = 1e9
#: Logarithms of the likelihood ratio at which arrivals confirm times, and speak against them.
_CONFIRM: Final = 3.0
_AGAINST: Final = 6.0
#: Logarithm of the ratio at which arrivals contradict times: two frames that came as usual after another pulse.
_CONTRADICT: Final = 14.0
#: Arrivals tell one pulse from the next if their standard deviation is at most the period divided by this.
_PERIOD_TO_SIGMA: Final = 2
#: Shifts of up to so many periods are tested.
_SHIFTS: Final = 8


class ArrivalTest(NamedTuple):
    """Result of the test for some frames.

    Attributes:
        usual: logarithm of the likelihood ratio of usual arrivals to the best other hypothesis.
        shifted: the same of arrivals after other pulses.
    """

    usual: float
    shifted: float

    @property
    def confirms(self) -> bool:
        """The arrivals confirm the times."""
        return self.usual >= _CONFIRM

    @property
    def speaks_against(self) -> bool:
        """The arrivals speak against the times, but a few frames may have come so by chance."""
        return self.shifted >= _AGAINST

    @property
    def contradicts(self) -> bool:
        """The arrivals contradict the times."""
        return self.shifted >= _CONTRADICT


class Arrivals:
    """Distribution of the latency of one camera, from the trigger of a frame to its arrival.

    Args:
        train: the rhythm of the pulses.

    Attributes:
        frames: how many frames have been entered.
        longest_ns: longest latency of late.
    """

    def __init__(self, train: PulseTrain) -> None:
        self._train = train
        self.frames = self._learned = 0
        self.longest_ns = 0.0
        self._usual_ns, self._sigma_ns = 0.0, _LEAST_NS
        self._latencies: deque[int] = deque(maxlen=_RECENT)
        self._heard: deque[tuple[HostNs, int]] = deque(maxlen=LASTING)  # arrivals and latencies

    def forget(self) -> None:
        """Learn the latencies anew: frames have another way, or another exposure."""
        self._learned = 0
        self._latencies.clear()
        self._heard.clear()

    def heard(self, arrival: HostNs, latency_ns: int) -> None:
        """Note a frame that has come, whether it will be accepted or not."""
        self._heard.append((arrival, latency_ns))

    def change_ns(self, read: HostNs) -> float | None:
        """By how much the last few frames all came later than usual; None: by different times, or nobody knows.

        Args:
            read: when the camera's clock was last read and went on as before. Frames that came later have perhaps the
                time of a clock that was set.
        """
        if self.scatter or len(self._heard) < LASTING or read < self._heard[0][0]:
            return None
        late = [latency_ns for _, latency_ns in self._heard]
        return sum(late) / LASTING - self._usual_ns if max(late) - min(late) <= self._train.period_ns / 4 else None

    def add(self, latency_ns: int) -> None:
        """Enter the latency of an accepted frame."""
        self.frames += 1
        self._learned += 1
        self._latencies.append(latency_ns)
        if self._has_changed():  # the median of times before and after it would be no time at all
            self.forget()
        if self._latencies and self._learned % _LEARN_EVERY == 0:
            self._learn()
        longer = latency_ns - self.longest_ns
        self.longest_ns += longer if longer > 0 else _DECAY * longer

    def _has_changed(self) -> bool:
        """Whether the last few accepted frames all came later, or sooner, than usual by the same."""
        if self.scatter:
            return False
        last = list(islice(reversed(self._latencies), LASTING))
        quarter = self._train.period_ns / 4
        return max(last) - min(last) <= quarter < abs(sum(last) / LASTING - self._usual_ns)

    def _learn(self) -> None:
        """Learn median and scatter by quantiles, on which single late frames have no weight."""
        ordered = sorted(self._latencies)
        low, self._usual_ns = (float(ordered[round(share * (len(ordered) - 1))]) for share in _QUANTILES)
        inflation = 1 + 2 / math.sqrt(len(ordered))  # a few arrivals may lie closer together than all do
        self._sigma_ns = max(inflation * (self._usual_ns - low), _LEAST_NS)

    @property
    def scatter(self) -> bool:
        """Whether arrivals scatter so widely that they cannot tell one pulse from the next, or may do so."""
        return self._learned < _KNOWN or self._sigma_ns > self._train.period_ns / _PERIOD_TO_SIGMA

    def is_usual(self, latency_ns: int) -> bool:
        """Whether a frame of this latency cannot be of a neighbouring pulse."""
        return self.scatter or abs(latency_ns - self._usual_ns) < self._train.period_ns / 2

    def test(self, latencies_ns: Sequence[int]) -> ArrivalTest:
        """Test frames of one rhythm, by their latencies."""
        if self.scatter:
            return ArrivalTest(usual=0.0, shifted=-_CONFIRM)
        late, sigma = [latency - self._usual_ns for latency in latencies_ns], self._sigma_ns
        usual = sum(_log_likelihood(each, sigma) for each in late)
        slow = math.log(_IDLE) - len(late) * math.log(_ANYWHERE_NS)
        period = self._train.period_ns
        shifted = max(
            sum(_log_likelihood(each - shift * period, sigma) for each in late)
            for shift in range(-_SHIFTS, _SHIFTS + 1)
            if shift != 0
        )
        return ArrivalTest(usual=usual - max(slow, shifted), shifted=shifted - max(usual, slow))


def _log_likelihood(off_ns: float, sigma_ns: float) -> float:
    """Logarithm of the likelihood of an arrival, so much later than usual."""
    bell = math.exp(-0.5 * (off_ns / sigma_ns) ** 2) / (sigma_ns * math.sqrt(2 * math.pi))
    return math.log((1 - _IDLE) * bell + _IDLE / _ANYWHERE_NS)
