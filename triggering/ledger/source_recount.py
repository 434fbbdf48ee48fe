"""Compares the tags of a log with the reports of the source of the pulses, and with the counts of the pairing.

The log's health records hold the reports of the source, some pulses each (`rig.health.ToldPulses`), and the counts that
the pairing had at that moment (`SourcePairing`). Here all reports are there at once. A pulse of the source and a tag
are the same if neither has a nearer one within half of the source's interval, after the median delay of exposures
behind edges is subtracted. As in the pairing, times whose error could swap pulses prove nothing, and times without a
report are not judged.
"""

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from statistics import median
from typing import Final

from rig.clocks import NS_PER_S, NS_PER_US, UtcNs
from rig.frame import FrameStatus
from rig.health import Health, SourcePairing, ToldPulses
from rig.pulse import PulseNumber
from rig.tag import TripletTag
from triggering.ledger.recounted import SourceAccount

#: Share of the distance at which two pulses are the same that the error of the source's clock may take.
_SHARE: Final = 0.5
#: The pairing has decided a pulse and received the report of it after so long, or so many periods.
_SETTLED_NS: Final = NS_PER_S
_SETTLED_PERIODS: Final = 12
#: Pulses that are listed one by one.
_KEPT: Final = 1000
#: Times and pulse numbers of a recorder have 63 bits; others stand in damaged logs only, and prove nothing.
_LARGEST: Final = (1 << 63) - 1
#: The interval of the pulses is known from so many.
_TIMED: Final = 3


@dataclass(slots=True)
class _Stretch:
    """Consecutive pulses by the source's count; all from the first one to `until` have been reported."""

    times: "array[int]"
    until: int


@dataclass(slots=True)
class _Found:
    """Result of the comparison: times of pulses, UTC."""

    fired: int = 0
    unseen: list[int] = field(default_factory=list)
    untagged: list[int] = field(default_factory=list)
    unfired: list[int] = field(default_factory=list)


class SourceRecount:
    """Takes tags and health records of a log in their order."""

    def __init__(self) -> None:
        self._pulses, self._times, self._unseen = array("q"), array("q"), bytearray()
        self._reports: list[ToldPulses] = []
        self._to_utc: int | None = None
        self._live: list[tuple[int, SourcePairing]] = []

    def add(self, tag: TripletTag) -> None:
        """Take the next tag; a tag not later than the last, or of a kind no recorder writes, is left out."""
        if not _credible(tag.pulse, tag.time) or (self._times and tag.time <= self._times[-1]):
            return
        statuses = {camera.status for camera in tag.cameras}
        self._pulses.append(tag.pulse)
        self._times.append(tag.time)
        self._unseen.append(FrameStatus.OK not in statuses and FrameStatus.MISSED in statuses)

    def reported(self, health: Health, written: UtcNs) -> None:
        """Take a health record.

        Args:
            health: the record.
            written: time of its message.
        """
        source = health.pairing.source
        if source is not None:
            self._live.append((written, source))
        if health.host_time_ns is None:
            return
        behind = written - health.host_time_ns  # a record is written at once, or a little later
        self._to_utc = behind if self._to_utc is None else min(self._to_utc, behind)
        self._reports += [report for report in health.fired or () if _credible(*report.times_ns, report.until_ns)]

    def finish(self) -> SourceAccount | None:
        """Compare everything; None: the log holds no reports of the source, or too inexact ones."""
        times = [time for report in self._reports for time in report.times_ns]
        if self._to_utc is None or len(times) < _TIMED or not self._times:
            return None
        period = median(after - before for before, after in pairwise(times))
        stretches = list(_stretches(self._reports, _SHARE * period / 2))
        found, shift = _Found(), self._to_utc + self._delay(stretches, period / 2)
        for stretch in stretches:
            self._compare(stretch, shift, period, found)
        findings = list(self._named(found))
        if len(stretches) == 1:
            findings += self._contradictions(found, max(_SETTLED_NS, round(_SETTLED_PERIODS * period)))
        return SourceAccount(found.fired, len(found.unseen), len(found.untagged), len(found.unfired), tuple(findings))

    def _delay(self, stretches: Sequence[_Stretch], reach: float) -> int:
        """How long after the edge of a pulse the cameras expose, ns."""
        delays = []
        for time in (time for stretch in stretches for time in stretch.times):
            place = time + (self._to_utc or 0)
            nearest = _nearest(self._times, place)
            off = self._times[nearest] - place
            if abs(off) <= reach and not self._unseen[nearest]:
                delays.append(off)
        return round(median(delays)) if delays else 0

    def _compare(self, stretch: _Stretch, shift: int, period: float, found: _Found) -> None:
        """Compare a stretch with the tags of its time; pulses before the first tag and after the last are no matter."""
        places = [time + shift for time in stretch.times]
        gaps = [min(period, after - before) for before, after in pairwise(places)] or [period]
        reaches = [min(gaps[max(0, n - 1) : n + 1]) / 2 for n in range(len(places))]
        first, last = self._times[0], self._times[-1]
        matched = set()
        for place, reach in zip(places, reaches, strict=True):
            if not first - reach <= place <= last + reach:
                continue
            found.fired += 1
            nearest = _nearest(self._times, place)
            if abs(self._times[nearest] - place) > reach or nearest in matched:
                found.untagged.append(place)
                continue
            matched.add(nearest)
            if self._unseen[nearest]:
                found.unseen.append(self._times[nearest])
        begin = bisect_left(self._times, places[0] - reaches[0])
        end = bisect_right(self._times, stretch.until + shift - reaches[-1])
        found.unfired.extend(self._times[index] for index in range(begin, end) if index not in matched)

    def _named(self, found: _Found) -> Iterator[str]:
        for time in found.untagged[:_KEPT]:
            before = self._pulses[max(0, bisect_right(self._times, time) - 1)]
            yield f"the source fired a pulse about {_ms(self._after(time))} ms after pulse {before} that has no tag"
        for time in found.unfired[:_KEPT]:
            pulse = PulseNumber(self._pulses[bisect_left(self._times, time)])
            yield f"pulse {pulse}: the source did not fire it"

    def _after(self, time: int) -> int:
        return time - self._times[max(0, bisect_right(self._times, time) - 1)]

    def _contradictions(self, found: _Found, settled: int) -> Iterator[str]:
        """Counts of the pairing that contradict the result; its decisions come up to `settled` ns late."""
        live = [each for each in self._live if each[0] >= self._times[0] + settled]
        if not live:
            return
        (begin, before), (end, after) = live[0], live[-1]
        for name, times in (("unseen", found.unseen), ("untagged", found.untagged), ("unfired", found.unfired)):
            counted = getattr(after, name) - getattr(before, name)
            least = sum(begin <= time < end - settled for time in times)
            most = sum(begin - settled <= time < end for time in times)
            if counted < 0:  # the recorder began anew
                return
            too_few = counted < least and name != "unseen"  # frame numbers may have proven an unseen one first
            if counted > most or too_few:
                yield f"live, {counted} pulses were counted as {name}, and by the log it is {least} to {most}"


def _stretches(reports: Sequence[ToldPulses], error_ns: float) -> Iterator[_Stretch]:
    """The stretches of reports whose times are no more uncertain than `error_ns`."""
    stretch, follows = None, None
    for report in reports:
        if report.times_ns and (report.first != follows or report.uncertainty_us * NS_PER_US > error_ns):
            if stretch is not None:
                yield stretch
            stretch = None
        if report.times_ns:
            follows = report.first + len(report.times_ns)
            if report.uncertainty_us * NS_PER_US <= error_ns:
                stretch = stretch or _Stretch(array("q"), report.times_ns[0])
                stretch.times.extend(report.times_ns)
        if stretch is not None:
            stretch.until = report.until_ns
    if stretch is not None:
        yield stretch


def _credible(*numbers: int) -> bool:
    return all(abs(number) <= _LARGEST for number in numbers)


def _nearest(times: Sequence[int], place: int) -> int:
    """Index of the time that is nearest to a place."""
    after = bisect_left(times, place)
    return min(range(max(0, after - 1), min(len(times), after + 1)), key=lambda index: abs(times[index] - place))


def _ms(ns: int) -> float:
    return round(ns / 1e6, 1)
