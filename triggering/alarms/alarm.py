"""An alarm of a running rig: its cause, its level, and the part that its events are about."""

from dataclasses import dataclass
from typing import Final

from rig.events import Level
from rig.phrase import Phrase, phrase

#: Topics on which several tests judge.
STOPPED: Final = "stopped"
RATE: Final = "rate"
SPREAD: Final = "spread"


@dataclass(frozen=True, slots=True)
class Alarm:
    """One fault.

    Attributes:
        topic: the subject; there is one alarm of each topic at a time.
        level: `WARNING`, or `ERROR` where recordings suffer.
        name: the part that its events are about.
        said: the fault; the remedy stands behind its colon.
    """

    topic: str
    level: Level
    name: str
    said: Phrase

    @property
    def over(self) -> Phrase:
        """The message that the fault is over."""
        what = Phrase(self.said.code, self.said.text.partition(": ")[0], self.said.values)
        return phrase("alarm_over", "over: {what}", what=what)
