"""Compares the pulses reported by the source with the pulses seen by the cameras.

A pulse of which no camera has a frame is in the log all the same if the source reports it, and each decided pulse is
compared with the reports. A report comes some time after its pulse, so a pulse behind a gap waits for it; in an
unbroken train nothing waits.

Source and cameras time different events: exposure may begin later than the edge of the pulse. This offset is learned
from the pulses that both have. Two pulses are the same if no other pulse of the source is nearer. Times for which there
is no report, or no exact one, are not judged.
"""

from collections import deque
from dataclasses import dataclass
from typing import Final

from rig.clocks import NS_PER_S, HostNs
from triggering.timeline.pulse_train import PulseTrain

#: Reports of a source that has been silent for so long are not waited for.
_SILENT_NS: Final = NS_PER_S
#: Decided pulses that wait for a report; older ones are forgotten.
_WAITING: Final = 1024
#: The offset is the median of so many differences, the last ones: the first may be far off, since a camera's clock is
#: hardly known then, or a busy computer read one late; such a difference must not shift the pulses that no camera saw.
_DIFFERENCES: Final = 21
#: Share of the distance at which two pulses are the same that the error of the source's clock may take.
_SHARE: Final = 0.5
#: Between pulses further apart than so many periods there is room for another.
_GAP_PERIODS: Final = 1.5


@dataclass(slots=True)
class FiredCounts:
    """What the comparison has shown so far.

    Attributes:
        reported: pulses that the source has reported.
        unseen: how many of them no camera delivered a frame of, and a camera that was there missed.
        untagged: how many of them the log lacks: the report came too late.
        unfired: decided pulses that the source did not fire.
        unseen_at, unfired_at: times of the last unseen and unfired pulse; an untagged pulse counts as unseen.
        uncertainty_ns: largest error of the last pulse's time.
    """

    reported: int = 0
    unseen: int = 0
    untagged: int = 0
    unfired: int = 0
    unseen_at: HostNs | None = None
    unfired_at: HostNs | None = None
    uncertainty_ns: int = 0


class _Reports:
    """The reports of the source, as it numbers its pulses.

    Attributes:
        intervals: the last two times between pulses whose numbers follow on one another.
    """

    def __init__(self) -> None:
        self.intervals: deque[int] = deque(maxlen=2)
        self._last: tuple[int, HostNs] | None = None

    def add(self, number: int, time: HostNs) -> bool:
        """Enter a pulse; returns whether its number follows on the last one: none in between was left out."""
        last, self._last = self._last, (number, time)
        if last is None or number != last[0] + 1:
            return False
        self.intervals.append(time - last[1])
        return True

    def interrupt(self) -> None:
        """Let the next number follow on none."""
        self._last = None


class _Offset:
    """By how much the times of the cameras' pulses are later than those of the source."""

    def __init__(self) -> None:
        self._differences: deque[int] = deque(maxlen=_DIFFERENCES)
        self._ns = 0

    def learn(self, difference_ns: int) -> None:
        """Enter the difference of a pulse that source and cameras have."""
        self._differences.append(difference_ns)
        self._ns = sorted(self._differences)[len(self._differences) // 2]

    def on_line(self, time: HostNs) -> float:
        """A time of the source on the common time line."""
        return time + self._ns


class FiredPulses:
    """Compares the pulses of the source with the decided ones; times are on the common time line.

    Args:
        train: the rhythm of the decided pulses.

    Attributes:
        counts: what the comparison has shown so far.
    """

    def __init__(self, train: PulseTrain) -> None:
        self._train = train
        self._queue: deque[HostNs] = deque()
        self._decided: deque[HostNs] = deque(maxlen=_WAITING)
        self._until: HostNs | None = None
        self._since = 0.0  # the source has left out reports before this
        self._trusted = False
        self._first: HostNs | None = None  # of the decided pulses
        self._before: HostNs | None = None  # the last decided pulse when the reports began
        self._reports, self._offset, self.counts = _Reports(), _Offset(), FiredCounts()

    @property
    def period_ns(self) -> float | None:
        """Time between the last two pulses by the source's clock; None: it has not reported two."""
        intervals = self._reports.intervals
        return float(intervals[-1]) if intervals else None

    @property
    def oldest(self) -> HostNs | None:
        """Time of the first pulse of the source that is not decided; None: there is none."""
        return HostNs(round(self._offset.on_line(self._queue[0]))) if self._queue else None

    @property
    def active(self) -> bool:
        """Whether there is a source that reports its pulses."""
        return self._until is not None

    def add(self, number: int, time: HostNs, uncertainty_ns: int) -> None:
        """Enter a pulse.

        Args:
            number: one more than that of the pulse before; otherwise some in between were not reported.
            time: when it fired.
            uncertainty_ns: largest error of the time.
        """
        self.counts.reported += 1
        self.counts.uncertainty_ns = uncertainty_ns
        follows = self._reports.add(number, time)
        reach, place = self._reach_ns, self._offset.on_line(time)
        self._trusted = uncertainty_ns <= _SHARE * reach
        if not self._trusted:
            self._decided.clear()
            self._reports.interrupt()  # the source has not left out the cameras' pulse at this time
            return
        if self._until is None:
            self._until = time
        if follows:
            self._forget_before(place - reach)
        else:
            self._before, self._since = self._train.last, place - reach
        while self._decided and self._decided[0] < place - reach:
            self._decided.popleft()  # there is no report for that time
        if self._decided and self._decided[0] <= place + reach:
            self._offset.learn(self._decided.popleft() - time)
        elif self._train.last is not None and place <= self._train.last + reach:
            self._pass_over(time)
        else:
            self._queue.append(time)

    def until(self, time: HostNs) -> None:
        """Note that all pulses up to `time` have been reported."""
        if self._trusted:
            self._until = time
            self._forget_before(self._offset.on_line(time) - self._reach_ns)

    def covers(self, time: HostNs) -> bool:
        """Whether the source has reported all pulses up to a time: there were no others."""
        return self._trusted and self._until is not None and self._offset.on_line(self._until) >= time

    def tells(self, now: HostNs) -> bool:
        """Whether the source reports its pulses at present: other pulses have not fired."""
        return self._trusted and self._until is not None and now < self._until + _SILENT_NS

    def waits(self, before: HostNs, now: HostNs) -> bool:
        """Whether a pulse behind a gap is to wait, since the source has not reported all pulses before it.

        Args:
            before: time of the pulse.
            now: present time.
        """
        last = self._train.last
        if self._until is None or last is None or now >= self._until + _SILENT_NS:
            return False
        return before - last > _GAP_PERIODS * self._train.period_ns and self._offset.on_line(self._until) < before

    def next_unseen(self, before: HostNs | None) -> HostNs | None:
        """Time of the next pulse of the source that is surely none of the open ones; None: there is none.

        Args:
            before: time of the first open pulse; None: there is none.
        """
        last = self._train.last
        while self._queue and last is not None and self._offset.on_line(self._queue[0]) <= last + self._reach_ns:
            self._pass_over(self._queue.popleft())
        if not self._queue:
            return None
        place = self._offset.on_line(self._queue[0])
        return None if before is not None and before <= place + self._reach_ns else HostNs(round(place))

    def skip(self) -> None:
        """Leave out the pulse of `next_unseen`: no camera has been there yet."""
        self._queue.popleft()

    def decided(self, time: HostNs, *, inserted: bool, seen: bool, missed: bool) -> None:
        """Enter a pulse that is decided.

        Args:
            time: of the pulse.
            inserted: it is the pulse that `next_unseen` returned.
            seen: a camera delivered a frame of it.
            missed: a camera that was there took no frame.
        """
        if inserted:
            self._queue.popleft()
            if missed:
                self.counts.unseen += 1
                self.counts.unseen_at = time
            return
        self._first = self._first or time
        if self._until is None:
            self._decided.append(time)
            return
        reach = self._reach_ns
        while self._queue and self._offset.on_line(self._queue[0]) < time - reach:
            self._pass_over(self._queue.popleft())
        if self._queue and self._offset.on_line(self._queue[0]) <= time + reach:
            fired = self._queue.popleft()
            if seen:
                self._offset.learn(time - fired)
            return
        if time >= self._since:
            self._decided.append(time)

    @property
    def _reach_ns(self) -> float:
        """Pulses of source and cameras that are this close are the same."""
        return min(self._reports.intervals, default=self._train.period_ns) / 2

    def _pass_over(self, time: HostNs) -> None:
        """Count a pulse that has no tag, unless the source or the cameras have only just begun."""
        place = self._offset.on_line(time)
        if self._first is not None and place > max(self._first, self._before or self._first):
            self.counts.untagged += 1
            self.counts.unseen_at = HostNs(round(place))

    def _forget_before(self, time: float) -> None:
        """Count the decided pulses that the source has passed over."""
        while self._decided and self._decided[0] < time:
            self.counts.unfired_at = self._decided.popleft()
            self.counts.unfired += 1
