"""Notices about the source of the pulses, each given when it is known, and again when it has become much worse."""

from typing import Final

from rig.events import Level
from rig.health import PairingHealth, PulsesMade
from rig.phrase import Phrase, phrase
from triggering.sources.choice import TriggerSource

#: A figure is given again when it is so many times as large.
_TOLD_AGAIN_FACTOR: Final = 2
#: The lateness of pulses is known when so many have been made.
_KNOWN_PULSES: Final = 100


def set_up_only(source: TriggerSource, health: PairingHealth) -> Phrase | None:
    """The warning not to measure in these frames, with what to do; None: they are good, or none have come yet.

    Args:
        source: of the pulses.
        health: state of the pairing.
    """
    if not source.set_up_only or health.seen == 0:
        return None
    if len(health.cameras) == 1:
        return phrase("trigger_software_one", "the camera is triggered by software: for set-up only, not to measure in")
    text = "software trigger, frames of a pulse lie up to {spread_ms} ms apart: for set-up only, not to measure in"
    return phrase("trigger_software", text, spread_ms=round(health.spread_max_us / 1000, 1))


class SpreadTeller:
    """Gives the warning of `set_up_only` as soon as the spread is known, and when it has become much larger.

    Args:
        source: of the pulses.
    """

    def __init__(self, source: TriggerSource) -> None:
        self._source = source
        self._told_us: float | None = None

    def tell(self, health: PairingHealth) -> Phrase | None:
        """The warning, if it is due now; None: it is not.

        Args:
            health: state of the pairing.
        """
        spread_us = health.spread_max_us
        if self._told_us is not None and (spread_us <= _TOLD_AGAIN_FACTOR * self._told_us):
            return None
        if len(health.cameras) > 1 and spread_us == 0:
            return None  # no pulse has frames of two cameras yet
        said = set_up_only(self._source, health)
        if said is not None:
            self._told_us = spread_us
        return said


class LatenessTeller:
    """Gives notices of how late the pulses of a line begin, and of pulses that were left out.

    Args:
        line: name of the line.
    """

    def __init__(self, line: str) -> None:
        self._line = line
        self._told_us: float | None = None
        self._told_skipped = 0

    def tell(self, made: PulsesMade) -> list[tuple[Level, Phrase]]:
        """The notices that are due now.

        Args:
            made: the pulses so far.
        """
        said = []
        if made.skipped >= max(1, _TOLD_AGAIN_FACTOR * self._told_skipped):
            self._told_skipped = made.skipped
            text = (
                "{line}: {skipped} pulses were left out so far, since the computer would have made them too late: "
                "close other programs, or lower trigger.rate_hz in the rig file"
            )
            said.append((Level.WARNING, phrase("gpio_skipped", text, line=self._line, skipped=made.skipped)))
        worst = made.late_max_us
        if (
            worst is not None
            and made.made >= _KNOWN_PULSES
            and (self._told_us is None or worst > _TOLD_AGAIN_FACTOR * self._told_us)
        ):
            self._told_us = worst
            text = (
                "{line}: pulses begin {median_us} us late (median), {p99_us} us (99 of 100), {max_us} us (the latest)"
            )
            median_us, p99_us = made.late_median_us or 0.0, made.late_p99_us or 0.0
            late = phrase("gpio_late", text, line=self._line, median_us=median_us, p99_us=p99_us, max_us=worst)
            said.append((Level.INFO, late))
        return said
