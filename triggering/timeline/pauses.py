"""Finds the pauses of a recording: stretches of time without a pulse, from the times of its tags.

An interval is judged by the median of the intervals around it, so a rate that changes is no pause, and the first
intervals are judged like the others. Pulses that come irregularly, from a hand or a light barrier, have no rhythm that
a pause could break: nothing is judged there.
"""

from collections import deque
from collections.abc import Iterator
from typing import Final

from rig.clocks import NS_PER_S, UtcNs
from rig.frame import FrameStatus
from rig.pulse import Pause, PulseNumber
from rig.tag import CameraTag, TripletTag

#: Intervals on either side of the one that is judged.
_AROUND: Final = 15
#: A pulse may come this many periods later than expected; beyond, there is room for another one in between.
_SLACK: Final = 0.5
#: The pulses have a rhythm if at least half of the intervals differ from their median by less than this share of it.
_REGULAR: Final = 0.05
_KEPT: Final = 1000
#: 16-bit block ids run from 1 to this and skip 0.
_IDS_16_BIT: Final = 65535

#: Two tags that follow each other in a log.
_Neighbours = tuple[TripletTag, TripletTag]


class PauseFinder:
    """Takes the tags of a recording in order; its memory does not grow with their number.

    Attributes:
        nominal_ns: the time between two pulses where there are fewer than three; None: not known.
    """

    def __init__(self) -> None:
        self.nominal_ns: float | None = None
        self._certain: list[Pause] = []
        self._around: deque[_Neighbours] = deque(maxlen=2 * _AROUND + 1)
        self._pending = 0
        self._period: float | None = None  # the latest known; for intervals that agree with it, no median is needed
        self._first_period: float | None = None

    def add(self, before: TripletTag, tag: TripletTag) -> None:
        """Enter two tags that follow each other in the log; the second is the later one."""
        self._around.append((before, tag))
        self._pending += 1
        if len(self._around) < 2 * _AROUND + 1:
            return
        while self._pending > _AROUND:
            pair = self._around[-self._pending]
            self._pending -= 1
            if self._period is None or abs(_interval(pair) - self._period) > _REGULAR * self._period:
                self._period = self._median()
                self._note(self._pause(pair, self._period))
            self._first_period = self._first_period or self._period

    def pauses(self) -> Iterator[Pause]:
        """The pauses between pulses so far, in order; of very many only the first."""
        yield from self._certain
        period = self._median()
        for place in range(len(self._around) - self._pending, len(self._around)):
            if (pause := self._pause(self._around[place], period)) is not None:
                yield pause

    def first_period(self) -> float | None:
        """Time between two pulses at the beginning, ns; None without a rhythm."""
        return self._first_period or self._median()

    def last_period(self) -> float | None:
        """Time between two pulses at the end, ns; None without a rhythm."""
        return self._median()

    def _note(self, pause: Pause | None) -> None:
        if pause is not None and len(self._certain) < _KEPT:
            self._certain.append(pause)

    def _median(self) -> float | None:
        """Median of the intervals in the window, ns; None if they have no rhythm."""
        if len(self._around) <= 1:
            return self.nominal_ns
        intervals = sorted(_interval(pair) for pair in self._around)
        median = intervals[(len(intervals) - 1) // 2]
        regular = sum(abs(interval - median) < _REGULAR * median for interval in intervals)
        return median if 2 * regular >= len(intervals) else None

    @staticmethod
    def _pause(pair: _Neighbours, period: float | None) -> Pause | None:
        before, after = pair
        span, steps = after.time - before.time, after.pulse - before.pulse
        if period is None or span <= (steps + _SLACK) * period:
            return None
        idle = _idle(before, after) if steps == 1 else ()
        return Pause(before.pulse, after.pulse, round(span / NS_PER_S, 6), round(span / period) - steps, idle)


def pause_of_margin(
    begin: UtcNs, end: UtcNs, after: PulseNumber, before: PulseNumber | None, period: float
) -> Pause | None:
    """The pause at the beginning or the end of a recording, None if there is none.

    Args:
        begin: where it can begin, UTC.
        end: where it can end, UTC.
        after: the last pulse before it, 0 if there is none.
        before: the first pulse after it, None if there is none.
        period: time between two pulses, ns.
    """
    span = end - begin
    if span <= (1 + _SLACK) * period:
        return None
    return Pause(after, before, round(span / NS_PER_S, 6), int(span / period))


def _interval(pair: _Neighbours) -> float:
    """Time from one pulse to the next, ns."""
    before, after = pair
    return (after.time - before.time) / (after.pulse - before.pulse)


def _idle(before: TripletTag, after: TripletTag) -> tuple[str, ...]:
    """The cameras that took no frame between two pulses: both frames are there, and their numbers are neighbours."""
    cameras = zip(before.cameras, after.cameras, strict=False)
    return tuple(now.name for last, now in cameras if _are_neighbours(last, now))


def _are_neighbours(last: CameraTag, now: CameraTag) -> bool:
    if not last.status is now.status is FrameStatus.OK or last.frame_id is None or now.frame_id is None:
        return False
    if last.trigger_count is not None and now.trigger_count is not None:
        return now.trigger_count - last.trigger_count == now.frame_id - last.frame_id == 1
    return now.frame_id - last.frame_id in {1, 1 - _IDS_16_BIT}
