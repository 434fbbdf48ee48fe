"""Counts what became of every pulse in every camera, from the tags of a log or of a recording in progress."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from typing import Final

from rig.api.recordings import Causes, Counts
from rig.clocks import NS_PER_S, UtcNs
from rig.frame import FrameStatus
from rig.pulse import Pause, PulseNumber
from rig.tag import TripletTag
from triggering.timeline.pauses import PauseFinder, pause_of_margin

_NONE: Final = PulseNumber(0)
_DIGITS_MAX: Final = 10  #: of a pulse number
#: Runs of incomplete pulses that are kept one by one; the counts go on.
_RUNS_KEPT: Final = 10_000
#: Offsets are counted in steps of 0.1 us; those of a second and more are one.
_STEPS_PER_US: Final = 10
_STEPS_MAX: Final = 10_000_000


@dataclass(frozen=True, slots=True)
class IncompleteRun:
    """Neighbouring pulses with the same fate; `cameras` are (name, status) of the cameras that delivered no frame."""

    first: PulseNumber
    last: PulseNumber
    cameras: tuple[tuple[str, FrameStatus], ...]

    def to_json(self) -> Iterator[dict[str, object]]:
        """Pulse by pulse: its number, and status by camera name."""
        statuses = {name: status.value for name, status in self.cameras}
        return ({"pulse": pulse, "cameras": statuses} for pulse in range(self.first, self.last + 1))


class Spread:
    """How far the trigger times of frames lie from their pulses: median and maximum, in memory that does not grow."""

    def __init__(self) -> None:
        self._counts: Counter[int] = Counter()
        self._largest = 0.0

    def add(self, offset_us: float) -> None:
        """Enter the offset of a frame, us."""
        size = abs(offset_us)
        self._largest = max(self._largest, size)
        self._counts[round(min(size * _STEPS_PER_US, _STEPS_MAX))] += 1

    def figures(self) -> dict[str, float] | None:
        """Median (to 0.1 us) and maximum, us; None without any offset."""
        wanted = (self._counts.total() + 1) // 2
        for step in sorted(self._counts):
            wanted -= self._counts[step]
            if wanted <= 0:
                return {"median": step / _STEPS_PER_US, "max": round(self._largest, 3)}
        return None


@dataclass(slots=True)
class FailedFrames:
    """The frames that did not come, or came damaged.

    Attributes:
        pulses: how many lack a frame.
        causes: missing frames by status.
        cameras: the same by name of the camera, without the cameras that delivered all frames.
        runs: runs of pulses with missing frames, the first ten thousand.
    """

    pulses: int = 0
    causes: Counter[FrameStatus] = field(default_factory=Counter)
    cameras: dict[str, Counter[FrameStatus]] = field(default_factory=dict)
    runs: list[IncompleteRun] = field(default_factory=list)
    _count: int = 0

    def add(self, pulse: PulseNumber, failed: tuple[tuple[str, FrameStatus], ...]) -> None:
        """Count the missing frames of a pulse: name and status of their cameras."""
        self.pulses += 1
        for name, status in failed:
            self.causes[status] += 1
            self.cameras.setdefault(name, Counter())[status] += 1
        last = self.runs[-1] if self.runs else None
        if last is not None and last.last == pulse - 1 and last.cameras == failed and self._count <= _RUNS_KEPT:
            self.runs[-1] = IncompleteRun(last.first, pulse, last.cameras)
            return
        self._count += 1
        if self._count <= _RUNS_KEPT:
            self.runs.append(IncompleteRun(pulse, pulse, failed))

    def in_words(self) -> Iterator[str]:
        """One line per run of pulses with the same fate, e.g. "pulses 61-64: K2 lost"."""
        for run in self.runs:
            fates = ", ".join(f"{name} {status.value}" for name, status in run.cameras)
            yield f"{span(run.first, run.last)}: {fates}"
        if self._count > _RUNS_KEPT:
            yield f"and {self._count - _RUNS_KEPT} more runs of pulses with missing frames"


@dataclass(slots=True)
class Ledger:
    """The account of a recording; tags are added in the order of the log. Its memory does not grow with their number.

    Attributes:
        pulses: number of tags.
        failed: the missing frames.
        missing: runs of pulses without a tag, as (first, last).
        out_of_order: pulses whose tag comes twice or too late.
        first_pulse: number of the first tag.
        last_pulse: highest pulse number so far.
        first_time, last_time: times of the first and the last pulse, UTC.
        spread: |offset_us| of all frames.
    """

    pulses: int = 0
    failed: FailedFrames = field(default_factory=FailedFrames)
    missing: list[tuple[int, int]] = field(default_factory=list)
    out_of_order: list[PulseNumber] = field(default_factory=list)
    first_pulse: PulseNumber = _NONE
    last_pulse: PulseNumber = _NONE
    first_time: UtcNs | None = None
    spread: Spread = field(default_factory=Spread)
    _last: TripletTag | None = None
    _pauses: PauseFinder = field(default_factory=PauseFinder)
    _begin: UtcNs | None = None
    _end: UtcNs | None = None
    _follows: PulseNumber = _NONE

    def follows(self, last: PulseNumber) -> None:
        """Say that an earlier log of the recording ends with pulse `last`, 0: there is none.

        The pulses between it and the first one of this log have no tag anywhere: they are a pause, not missing here.
        """
        self._follows = last
        if last and self.missing[:1] == [(1, self.first_pulse - 1)]:
            del self.missing[0]

    def add(self, tag: TripletTag) -> None:
        """Add the next tag of the log."""
        if tag.pulse <= self.last_pulse:
            self.out_of_order.append(tag.pulse)
            return
        if tag.pulse > self.last_pulse + 1 and not (self._last is None and self._follows):
            self.missing.append((self.last_pulse + 1, tag.pulse - 1))
        if self._last is None:
            self.first_time, self.first_pulse = tag.time, tag.pulse
        elif tag.time > self._last.time:
            self._pauses.add(self._last, tag)
        self.last_pulse, self._last = tag.pulse, tag
        self.pulses += 1
        failed = tuple((camera.name, camera.status) for camera in tag.cameras if camera.status is not FrameStatus.OK)
        if failed:
            self.failed.add(tag.pulse, failed)
        for camera in tag.cameras:
            if camera.offset_us is not None:
                self.spread.add(camera.offset_us)

    def lasted(self, begin: UtcNs | None, end: UtcNs | None, period_ns: float | None) -> None:
        """Say when the recording began and ended, so that time before the first and after the last pulse counts.

        Args:
            begin: UTC; None if it is not known.
            end: likewise.
            period_ns: nominal time between two pulses, for recordings of fewer than three; None likewise.
        """
        self._begin, self._end, self._pauses.nominal_ns = begin, end, period_ns

    @property
    def last_time(self) -> UtcNs | None:
        """Time of the last pulse, UTC; None if there is no pulse."""
        return None if self._last is None else self._last.time

    @property
    def complete(self) -> int:
        """Pulses that every camera delivered."""
        return self.pulses - self.failed.pulses

    @property
    def whole(self) -> bool:
        """Whether nothing is missing: every pulse has a tag and all its frames, and there is no pause."""
        return not (self.failed.pulses or self.missing or self.out_of_order or self.pauses())

    @property
    def duration_s(self) -> float:
        """Time from the first to the last pulse, s."""
        if self.first_time is None or self.last_time is None:
            return 0.0
        return (self.last_time - self.first_time) / NS_PER_S

    @property
    def rate_hz(self) -> float | None:
        """Pulses per second, None if there are fewer than two."""
        return (self.last_pulse - self.first_pulse) / self.duration_s if self.duration_s > 0 else None

    def pauses(self) -> tuple[Pause, ...]:
        """The stretches of time without a pulse, in order; of very many only the first thousand and the last ones.

        This is the one account of time: every report and every verdict asks here.
        """
        finder = self._pauses
        if self._last is None:
            return tuple(self._margin(self._begin, self._end, None, finder.last_period()))
        at_begin = self.first_time if self.first_pulse == self._follows + 1 else None
        return (
            *self._between_logs(),
            *self._margin(self._begin, at_begin, self.first_pulse, finder.first_period()),
            *finder.pauses(),
            *self._margin(self._last.time, self._end, None, finder.last_period()),
        )

    def _between_logs(self) -> Iterator[Pause]:
        """The pulses that neither the log before this one has nor this one."""
        pulses = self.first_pulse - self._follows - 1
        if self._follows and pulses > 0 and self._begin is not None and self.first_time is not None:
            seconds = round((self.first_time - self._begin) / NS_PER_S, 6)
            yield Pause(self._follows, self.first_pulse, seconds, pulses)

    def _margin(
        self, begin: UtcNs | None, end: UtcNs | None, before: PulseNumber | None, period: float | None
    ) -> Iterator[Pause]:
        if begin is None or end is None or period is None:
            return
        after = self.last_pulse if before is None else self._follows
        if (pause := pause_of_margin(begin, end, after, before, period)) is not None:
            yield pause

    def states(self, names: Iterable[str]) -> dict[str, dict[str, int]]:
        """How many pulses have which of the five states, by name of the camera.

        Args:
            names: of the cameras, in the order wanted.
        """
        failures = {name: self.failed.cameras.get(name, Counter[FrameStatus]()) for name in names}
        return {
            name: {
                status.value: self.pulses - failed.total() if status is FrameStatus.OK else failed[status]
                for status in FrameStatus
            }
            for name, failed in failures.items()
        }

    def counts(self) -> Counts:
        """Pulses, complete, partial and causes, as every command reports them; causes count frames, not pulses."""
        failures = [status for status in FrameStatus if status is not FrameStatus.OK]
        causes = Causes(**{status.value: self.failed.causes[status] for status in failures})
        return Counts(pulses=self.pulses, complete=self.complete, partial=self.failed.pulses, causes=causes)

    def incomplete_pulses(self, limit: int) -> list[dict[str, object]]:
        """The pulses with missing frames one by one, as JSON; at most `limit` of them."""
        return list(islice((pulse for run in self.failed.runs for pulse in run.to_json()), limit))

    def in_words(self) -> Iterator[str]:
        """One line per run of pulses with the same fate, e.g. "pulses 61-64: K2 lost", and one per pause."""
        yield from self.failed.in_words()
        for first, last in self.missing:
            yield f"{span(first, last)}: no tag, nothing is known of {'it' if first == last else 'them'}"
        for pause in self.pauses():
            yield pause.in_words()

    def summary_line(self) -> str:
        """The counts in words."""
        failed = ", ".join(f"{count} {status.value}" for status, count in sorted(self.failed.causes.items()))
        line = f"{self.pulses} pulses, {self.complete} complete, {self.failed.pulses} partial"
        line += f" (frames: {failed})" if failed else ""
        return f"{line}; {words}" if (words := pauses_in_words(self.pauses())) else line


def pauses_in_words(pauses: Iterable[Pause]) -> str:
    """The pauses of a recording in a few words, empty if there are none."""
    lengths = [pause.seconds for pause in pauses]
    if not lengths:
        return ""
    times = "" if len(lengths) == 1 else f" in {len(lengths)} pauses"
    return f"no pulses for {sum(lengths):.3g} s{times}"


def span(first: int, last: int) -> str:
    """A run of pulses in words."""
    return f"pulse {first}" if first == last else f"pulses {first}-{last}"


def runs_to_text(runs: Iterable[tuple[int, int]]) -> str:
    """Runs of pulses as text, e.g. "5-7 12"."""
    return " ".join(f"{first}" if first == last else f"{first}-{last}" for first, last in runs)


def runs_from_text(text: str) -> list[tuple[int, int]]:
    """Read what `runs_to_text` wrote; words that are no runs are left out."""
    runs = []
    for word in text.split():
        first, _, last = word.partition("-")
        if all(
            number.isascii() and number.isdecimal() and len(number) <= _DIGITS_MAX for number in (first, last or first)
        ):
            runs.append((int(first), int(last or first)))
    return runs


def numbers(runs: Iterable[tuple[int, int]], limit: int) -> list[int]:
    """The pulses of runs one by one, at most `limit` of them."""
    every = (pulse for first, last in runs for pulse in range(first, last + 1))
    return list(islice(every, limit))
