"""Counts what became of every pulse in every camera, from the tags of a log or of a recording in progress."""

from array import array
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from itertools import groupby, islice
from statistics import median
from typing import Any, Final

from rig.clocks import NS_PER_S, UtcNs
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.status import Causes, Counts
from rig.tag import TripletTag

_NONE: Final = PulseNumber(0)
_DIGITS_MAX: Final = 10  #: of a pulse number


@dataclass(frozen=True, slots=True)
class Incomplete:
    """A pulse with missing frames; `cameras` are (name, status) of the cameras that delivered none."""

    pulse: PulseNumber
    cameras: tuple[tuple[str, FrameStatus], ...]

    def to_json(self) -> dict[str, Any]:
        """Pulse, and status by camera name."""
        return {"pulse": self.pulse, "cameras": {name: status.value for name, status in self.cameras}}


@dataclass(slots=True)
class Ledger:
    """The account of a recording; tags are added in the order of the log.

    Attributes:
        pulses: number of tags.
        causes: missing frames by status.
        incomplete: the pulses with missing frames.
        missing: runs of pulses without a tag, as (first, last).
        out_of_order: pulses whose tag comes twice or too late.
        last_pulse: highest pulse number so far.
        first_time, last_time: times of the first and the last pulse, UTC.
        offsets_us: |offset_us| of all frames.
    """

    pulses: int = 0
    causes: Counter[FrameStatus] = field(default_factory=Counter)
    incomplete: list[Incomplete] = field(default_factory=list)
    missing: list[tuple[int, int]] = field(default_factory=list)
    out_of_order: list[PulseNumber] = field(default_factory=list)
    last_pulse: PulseNumber = _NONE
    first_time: UtcNs | None = None
    last_time: UtcNs | None = None
    offsets_us: "array[float]" = field(default_factory=lambda: array("d"))

    def add(self, tag: TripletTag) -> None:
        """Add the next tag of the log."""
        if tag.pulse <= self.last_pulse:
            self.out_of_order.append(tag.pulse)
            return
        if tag.pulse > self.last_pulse + 1:
            self.missing.append((self.last_pulse + 1, tag.pulse - 1))
        self.last_pulse = tag.pulse
        self.pulses += 1
        self.first_time = tag.time if self.first_time is None else self.first_time
        self.last_time = tag.time
        failed = tuple((camera.name, camera.status) for camera in tag.cameras if camera.status is not FrameStatus.OK)
        if failed:
            self.causes.update(status for _, status in failed)
            self.incomplete.append(Incomplete(tag.pulse, failed))
        self.offsets_us.extend(abs(camera.offset_us) for camera in tag.cameras if camera.offset_us is not None)

    @property
    def complete(self) -> int:
        """Pulses that every camera delivered."""
        return self.pulses - len(self.incomplete)

    @property
    def duration_s(self) -> float:
        """Time from the first to the last pulse, s."""
        if self.first_time is None or self.last_time is None:
            return 0.0
        return (self.last_time - self.first_time) / NS_PER_S

    @property
    def rate_hz(self) -> float | None:
        """Pulses per second, None if there are fewer than two."""
        return (self.last_pulse - self._first_pulse) / self.duration_s if self.duration_s > 0 else None

    @property
    def _first_pulse(self) -> int:
        return self.missing[0][1] + 1 if self.missing and self.missing[0][0] == 1 else 1

    def counts(self) -> Counts:
        """Pulses, complete, partial and causes, as every command reports them; causes count frames, not pulses."""
        failures = [status for status in FrameStatus if status is not FrameStatus.OK]
        causes = Causes(**{status.value: self.causes[status] for status in failures})
        return Counts(pulses=self.pulses, complete=self.complete, partial=self.pulses - self.complete, causes=causes)

    def spread_us(self) -> dict[str, float] | None:
        """Median and maximum of |offset_us|: how well the cameras' triggers agree; None without any."""
        if not self.offsets_us:
            return None
        return {"median": round(median(self.offsets_us), 3), "max": round(max(self.offsets_us), 3)}

    def in_words(self) -> Iterator[str]:
        """One line per run of pulses with the same fate, e.g. "pulses 61-64: K2 lost"."""
        runs = groupby(enumerate(self.incomplete), key=lambda entry: (entry[1].pulse - entry[0], entry[1].cameras))
        for (_, cameras), run in runs:
            pulses = [entry.pulse for _, entry in run]
            yield f"{span(pulses[0], pulses[-1])}: " + ", ".join(f"{name} {status.value}" for name, status in cameras)
        for first, last in self.missing:
            yield f"{span(first, last)}: no tag, nothing is known of {'it' if first == last else 'them'}"

    def summary_line(self) -> str:
        """The counts in words."""
        failed = ", ".join(f"{count} {status.value}" for status, count in sorted(self.causes.items()))
        line = f"{self.pulses} pulses, {self.complete} complete, {self.pulses - self.complete} partial"
        return line + (f" (frames: {failed})" if failed else "")


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
