"""An alarm of a running rig: what is wrong, how bad it is, and whom events name as what it is about."""

from dataclasses import dataclass

from rig.events import Level
from rig.phrase import Phrase, phrase


@dataclass(frozen=True, slots=True)
class Alarm:
    """One thing that is wrong.

    Attributes:
        topic: what may be wrong; of each topic there is one alarm at a time.
        level: `WARNING`, or `ERROR` where recordings suffer.
        name: which part its events are about.
        said: what is wrong; what to do stands behind its colon.
    """

    topic: str
    level: Level
    name: str
    said: Phrase

    @property
    def over(self) -> Phrase:
        """That it is over."""
        what = Phrase(self.said.code, self.said.text.partition(": ")[0], self.said.values)
        return phrase("alarm_over", "over: {what}", what=what)
