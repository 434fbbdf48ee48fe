"""What the service says to people: a text with advice and a `code` by which the page translates it."""

from enum import StrEnum

from pydantic import Field

from rig.api.fields import Model
from rig.phrase import Phrase, Value


class Level(StrEnum):
    """Severity of a statement."""

    GOOD = "good"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class Statement(Model):
    """One sentence for people, with what to do.

    Attributes:
        level: severity.
        code: stable name of the statement, for translation, e.g. `camera_absent`.
        text: the statement in English, one line.
        advice: what to do about it, empty if nothing.
        values: names and numbers in the text, for translation, e.g. `{"camera": "K2"}`; also sentences with codes of
            their own, e.g. why a recording ended.
    """

    level: Level = Level.INFO
    code: str
    text: str
    advice: str = ""
    values: dict[str, Value] = Field({})

    @property
    def said(self) -> Phrase:
        """The statement without its level and advice."""
        return Phrase(self.code, self.text, self.values)
