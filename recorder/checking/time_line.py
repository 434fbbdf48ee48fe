"""Finds the messages of a log that stand far outside of its pulses, and make it last longer than its recording did."""

from collections.abc import Iterator
from typing import Final

from recorder.reading.items import Chunk, Message
from rig.clocks import NS_PER_S, UtcNs
from rig.topics import HEALTH, TAG, TRIPLET

#: Topics whose messages come by the clock of the pulses.
_ON_TIME: Final = frozenset({TAG.name, TRIPLET.name, HEALTH.name})
_FAR_NS: Final = 60 * NS_PER_S
_WHY: Final = "the computer's clock was set, or the log was repaired later; other programs take the log for that long"
_UNITS: Final = ((86400.0, "days"), (3600.0, "h"), (60.0, "min"))


class TimeLine:
    """Takes the messages of a log in any order."""

    def __init__(self) -> None:
        self._span: tuple[UtcNs, UtcNs] | None = None
        self._others: dict[str, tuple[UtcNs, UtcNs]] = {}

    def take(self, chunk: Chunk) -> None:
        """Note the times of a chunk's messages."""
        for message in chunk.messages:
            if message.topic in _ON_TIME:
                self._span = _wider(self._span, message)
            else:
                self._others[message.topic] = _wider(self._others.get(message.topic), message)

    def in_words(self) -> Iterator[str]:
        """What stands outside, one sentence for each topic."""
        if self._span is None:
            return
        first, last = self._span
        for topic, (earliest, latest) in sorted(self._others.items()):
            if earliest < first - _FAR_NS:
                yield f"messages on {topic} stand {_length(first - earliest)} before the first pulse: {_WHY}"
            if latest > last + _FAR_NS:
                yield f"messages on {topic} stand {_length(latest - last)} after the last pulse: {_WHY}"


def _wider(span: tuple[UtcNs, UtcNs] | None, message: Message) -> tuple[UtcNs, UtcNs]:
    time = message.log_time
    return (time, time) if span is None else (min(span[0], time), max(span[1], time))


def _length(nanoseconds: int) -> str:
    seconds = nanoseconds / NS_PER_S
    return next((f"{seconds / size:.1f} {unit}" for size, unit in _UNITS if seconds >= size), f"{seconds:.0f} s")
