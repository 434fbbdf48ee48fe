"""Says how even the pulses of a line are: when that is known, and when it becomes worse."""

from typing import Final

from rig.events import Level
from rig.health import PulsesMade
from rig.phrase import Phrase, phrase

#: The lateness is told when so many pulses have been made,
_ENOUGH: Final = 100
#: and again when it is so many times as large; so are pulses that were left out.
_AGAIN: Final = 2


class LatenessTeller:
    """Decides what is told, and when.

    Args:
        line: name of the line.
    """

    def __init__(self, line: str) -> None:
        self._line = line
        self._told_us: float | None = None
        self._told_skipped = 0

    def tell(self, made: PulsesMade) -> list[tuple[Level, Phrase]]:
        """What is to be told now.

        Args:
            made: what has been made.
        """
        said = []
        if made.skipped >= max(1, _AGAIN * self._told_skipped):
            self._told_skipped = made.skipped
            text = (
                "{line}: {skipped} pulses were left out so far, since the computer would have made them too late: "
                "close other programs, or lower trigger.rate_hz in the rig file"
            )
            said.append((Level.WARNING, phrase("gpio_skipped", text, line=self._line, skipped=made.skipped)))
        worst = made.late_max_us
        if worst is not None and made.made >= _ENOUGH and (self._told_us is None or worst > _AGAIN * self._told_us):
            self._told_us = worst
            text = (
                "{line}: pulses begin {median_us} us late (median), {p99_us} us (99 of 100), {max_us} us (the latest)"
            )
            median_us, p99_us = made.late_median_us or 0.0, made.late_p99_us or 0.0
            late = phrase("gpio_late", text, line=self._line, median_us=median_us, p99_us=p99_us, max_us=worst)
            said.append((Level.INFO, late))
        return said
