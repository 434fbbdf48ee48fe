"""What the stages of the search for gross errors found, for result files, reports and the screen."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from photogrammetry.adjustment.gross_errors.suspicion import FAMILY_RISK
from photogrammetry.network.model import Role
from rig.phrase import Phrase, phrase
from rig.phrases import in_turn

#: Roles of points whose given coordinates the adjustment uses.
SURVEYED: Final = (Role.CONTROL, Role.FIXED)
#: Probability that a stage suspects anything in sound data; all three together have that of one adjustment.
STAGE_RISK: Final = FAMILY_RISK / 3
_TOLD: Final = 4  # findings in the message of a refusal, at most


class StageName(StrEnum):
    """The stages, in their order."""

    FREE = "free adjustment"
    SIMILARITY = "similarity transformation onto the reference points"
    CONSTRAINED = "constrained adjustment"


@dataclass(frozen=True, slots=True)
class Finding:
    """A gross error that a stage found.

    Attributes:
        said: names the observation, with its tests.
        removed: whether it was taken out.
    """

    said: Phrase
    removed: bool

    @property
    def message(self) -> str:
        """The same in English."""
        return self.said.text


@dataclass(frozen=True, slots=True)
class PointTest:
    """A reference point in the similarity transformation.

    Attributes:
        point: its name.
        v: transformed - surveyed, X, Y, Z.
        r: redundancy numbers.
        w: test values; NaN where nothing controls a coordinate.
    """

    point: str
    v: tuple[float, ...]
    r: tuple[float, ...]
    w: tuple[float, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """One stage.

    Attributes:
        name: of the stage.
        words: its figures, or why it was left out.
        findings: its gross errors, in the order found.
        tests: of the reference points, in the similarity transformation only.
    """

    name: StageName
    words: str
    findings: tuple[Finding, ...] = ()
    tests: tuple[PointTest, ...] = ()


def too_many(gone: Sequence[str], count: int) -> Phrase:
    """The refusal of a survey that would lose more than a third of its `count` points, those in `gone`."""
    text = (
        "the survey contradicts the images: {gone} of {count} reference points would have to go ({names}); check their "
        "names, coordinates and units, and survey them again"
    )
    return phrase("refused_points", text, gone=len(gone), count=count, names=", ".join(gone))


def told_of(refusal: Phrase, findings: Sequence[Phrase]) -> Phrase:
    """A refusal with what is known."""
    return in_turn([refusal, *findings[:_TOLD]])
