"""Finds jumps of which there may be no recording: somebody was seen, or called, while nothing was recorded."""

from typing import Final

from rig.api.start_list import StartList, TurnMark, who
from rig.api.statement import Level, Statement
from rig.phrase import Phrase

#: A recording that begins so soon after somebody came into sight has him: memory holds the seconds before.
_HELD_BEFORE_S: Final = 3.0
_ADVICE: Final = "if it was just now, press Save last jump; otherwise there is nothing to do"


class Unrecorded:
    """Looks about once a second. Only one thread may use it."""

    def __init__(self) -> None:
        self._moved_at: float | None = None
        self._refused: Phrase | None = None
        self._skipped: frozenset[int] = frozenset()
        self._called: int | None = None

    def moved(self, now: float) -> None:
        """Note that somebody has come into sight, and that no recording has begun for it.

        Args:
            now: on the monotonic clock, s.
        """
        self._moved_at = now if self._moved_at is None else self._moved_at

    def refused(self, why: Phrase) -> None:
        """Note that a jump came, and that no recording could begin for it, and why."""
        self._refused = why

    def look(self, start_list: StartList, *, waits: bool, now: float, recording: bool = False) -> Statement | None:
        """What may not be recorded, until a recording begins.

        Args:
            start_list: as it is.
            waits: whether the rig is armed, and nothing is being recorded.
            recording: whether something is being recorded.
            now: on the monotonic clock, s.
        """
        skipped = {line.id: line for line in start_list.lines if line.mark is TurnMark.SKIPPED}
        new = skipped.keys() - self._skipped
        self._skipped = frozenset(skipped)
        if recording:
            self._refused = None
        if self._refused is not None:
            text = f"a jump came, and no recording could begin: {self._refused}"
            values = {"why": self._refused}
            return Statement(
                level=Level.ERROR, code="alarm_unrecorded_refused", text=text, advice=_ADVICE, values=values
            )
        if not waits:
            self._moved_at = self._called = None
            return None
        self._called = next((line for line in skipped if line in new), self._called)
        if self._moved_at is not None and now > self._moved_at + _HELD_BEFORE_S:
            text = "somebody was seen while nothing was recorded: the last jump may not be recorded"
            return Statement(level=Level.WARNING, code="alarm_unrecorded_seen", text=text, advice=_ADVICE)
        if self._called is not None and (line := skipped.get(self._called)) is not None:  # else it was undone
            name = who(line)
            text = f"{name} was called, and nothing was recorded: the last jump may not be recorded"
            return Statement(
                level=Level.WARNING, code="alarm_unrecorded", text=text, advice=_ADVICE, values={"who": name}
            )
        return None
