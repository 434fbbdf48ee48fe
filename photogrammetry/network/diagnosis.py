"""Why a network cannot be solved: causes of rank defects in words, and the errors that carry them."""

from dataclasses import dataclass
from enum import StrEnum

from rig.errors import SvevError
from rig.phrase import Phrase
from rig.phrases import in_turn


class DefectKind(StrEnum):
    """What is undetermined."""

    DATUM = "datum"  #: position, rotation or scale of the whole network
    POINTS = "points"
    IMAGES = "images"
    PARAMETERS = "parameters"  #: interior orientation


@dataclass(frozen=True, slots=True)
class Defect:
    """One cause of a rank defect.

    Attributes:
        kind: what is undetermined.
        defect: how many unknowns (or combinations of them) stay undetermined; 0 where that is not known.
        said: in words, ending in what to do.
        points: names of the points concerned.
        images: names of the images concerned.
    """

    kind: DefectKind
    defect: int
    said: Phrase
    points: tuple[str, ...] = ()
    images: tuple[str, ...] = ()

    @property
    def message(self) -> str:
        """The same in English."""
        return self.said.text


class NotSolvableError(SvevError):
    """The network does not determine its unknowns; `defects` names them and the causes."""

    exit_code = 3

    def __init__(self, defects: tuple[Defect, ...]):
        super().__init__(in_turn([defect.said for defect in defects]))
        self.defects = defects


class NotConvergedError(SvevError):
    """The iteration did not reach an optimum."""

    exit_code = 4


class RefusedError(SvevError):
    """There is an optimum, but its data contradict each other so much that it must not be used."""

    exit_code = 4
