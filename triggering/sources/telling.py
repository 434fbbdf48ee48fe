"""Says of a source that is for set-up only how far apart it exposes the cameras."""

from rig.health import PairingHealth
from rig.phrase import Phrase, phrase
from triggering.sources.seam import TriggerSource

#: The spread is told again when it is so many times as large.
_AGAIN = 2.0


def set_up_only(source: TriggerSource, health: PairingHealth) -> Phrase | None:
    """The warning that frames are not to be measured in, with what to do; None: they may be, or none have come yet.

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
    """Decides when that is told: as soon as it is known, and when it has become much worse.

    Args:
        source: of the pulses.
    """

    def __init__(self, source: TriggerSource) -> None:
        self._source = source
        self._told_us: float | None = None

    def tell(self, health: PairingHealth) -> Phrase | None:
        """What is to be told now; None: nothing.

        Args:
            health: state of the pairing.
        """
        spread_us = health.spread_max_us
        if self._told_us is not None and (spread_us <= _AGAIN * self._told_us):
            return None
        if len(health.cameras) > 1 and spread_us == 0:
            return None  # no pulse has frames of two cameras yet
        said = set_up_only(self._source, health)
        if said is not None:
            self._told_us = spread_us
        return said
