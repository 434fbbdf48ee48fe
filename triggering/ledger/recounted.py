"""The recomputed ledger of a log, compared with its tags."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from rig.frame import FrameStatus
from rig.pulse import PulseNumber


@dataclass(frozen=True, slots=True)
class Difference:
    """A pulse and camera in which the tag and the recomputed ledger differ.

    Attributes:
        pulse: the pulse, or the first of several; where frames have no pulse, the one before them.
        camera: name of the camera.
        tagged: what the tag says.
        found: what follows from the log; None: no state of this pulse says it.
        why: the evidence, in words.
        last: the last pulse of a stretch that holds frames of other pulses.
        by: the frames of the stretch are of so many pulses later; negative: earlier; 0: not known, or no stretch.
    """

    pulse: PulseNumber
    camera: str
    tagged: FrameStatus
    found: FrameStatus | None
    why: str
    last: PulseNumber | None = None
    by: int = 0

    def to_json(self) -> dict[str, object]:
        """The difference as JSON."""
        found = None if self.found is None else self.found.value
        return {
            "pulse": self.pulse, "last_pulse": self.pulse if self.last is None else self.last, "camera": self.camera,
            "tagged": self.tagged.value, "found": found, "by_pulses": self.by, "why": self.why,
        }  # fmt: skip

    def in_words(self) -> str:
        """The difference as one line, e.g. "pulse 61: K2 is tagged lost and was missed: (why)"."""
        if self.last is not None:
            pulses = f"pulse {self.pulse}" if self.last == self.pulse else f"pulses {self.pulse} to {self.last}"
            pulse = "pulse" if abs(self.by) == 1 else "pulses"
            later = "later" if self.by > 0 else "earlier"
            return f"{pulses}: {self.camera} holds the frames of {abs(self.by)} {pulse} {later}: {self.why}"
        found = "" if self.found is None else f" and was {self.found.value}"
        return f"pulse {self.pulse}: {self.camera} is tagged {self.tagged.value}{found}: {self.why}"


@dataclass(frozen=True, slots=True)
class SourceAccount:
    """The reports of the source for the time in which the log has tags, compared with the tags.

    Attributes:
        fired: pulses that the source reports.
        unseen: how many of them no camera has a frame of, while a tag says that one missed it.
        untagged: how many of them have no tag.
        unfired: how many tags are of pulses that the source did not fire.
        findings: the untagged and unfired pulses in words, and counts of the pairing that contradict these.
    """

    fired: int
    unseen: int
    untagged: int
    unfired: int
    findings: tuple[str, ...]

    @property
    def agrees(self) -> bool:
        """Whether source, tags and pairing agree."""
        return not self.findings

    def to_json(self) -> dict[str, object]:
        """The account as JSON."""
        return {
            "fired": self.fired, "unseen": self.unseen, "untagged": self.untagged, "unfired": self.unfired,
            "findings": list(self.findings),
        }  # fmt: skip

    def summary_line(self) -> str:
        """The account in one line."""
        verdict = "agrees" if self.agrees else "does not agree"
        return (
            f"the source's own count {verdict}: {self.fired} pulses fired, {self.unseen} of them seen by no camera, "
            f"{self.untagged} without a tag; {self.unfired} tagged that it did not fire"
        )


@dataclass(frozen=True, slots=True)
class Recounted:
    """The recomputed ledger, beside the tags.

    Attributes:
        pulses: tags that were compared.
        states: recomputed, by camera: how many pulses have which state.
        unproven: missing frames whose state rests on the tag alone.
        differences: where tag and evidence differ, the first ten thousand.
        disagreements: how many there are.
        source: comparison with the reports of the source; None: the log holds none.
    """

    pulses: int
    states: dict[str, Counter[FrameStatus]]
    unproven: int
    differences: tuple[Difference, ...]
    disagreements: int
    source: SourceAccount | None = None

    @property
    def agrees(self) -> bool:
        """Whether nothing contradicts the tags: neither the frames nor the reports of the source."""
        return self.disagreements == 0 and (self.source is None or self.source.agrees)

    @property
    def misfiled(self) -> tuple[Difference, ...]:
        """The differences of whole frames: by their numbers and times these are of other pulses.

        The others concern the cause of a missing frame.
        """
        return tuple(difference for difference in self.differences if difference.found is None)

    def in_words(self) -> Iterator[str]:
        """One line for each disagreement that is kept."""
        yield from (difference.in_words() for difference in self.differences)
        if self.source is not None:
            yield from self.source.findings

    def to_json(self) -> dict[str, object]:
        """The recomputed ledger as JSON."""
        return {
            "agrees": self.agrees,
            "states": {name: states_json(states) for name, states in self.states.items()},
            "unproven": self.unproven,
            "disagreements": self.disagreements,
            "differences": [difference.to_json() for difference in self.differences],
            "source": None if self.source is None else self.source.to_json(),
        }

    def summary_line(self) -> str:
        """Agreement or not with the counts, one line."""
        total: Counter[FrameStatus] = Counter()
        for states in self.states.values():
            total.update(states)
        counts = ", ".join(f"{total[status]} {status.value}" for status in FrameStatus)
        verdict = (
            "agrees with the tags"
            if self.disagreements == 0
            else f"differs from the tags at {self.disagreements} places"
        )
        alone = f"; {self.unproven} of them by the tag alone" if self.unproven else ""
        return f"the recomputed ledger {verdict}: {self.pulses} pulses, {len(self.states)} cameras: {counts}{alone}"


def states_json(states: Counter[FrameStatus]) -> dict[str, int]:
    """How many pulses have which of the five states, as JSON."""
    return {status.value: states[status] for status in FrameStatus}
