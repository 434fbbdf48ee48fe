"""Why a network cannot be solved: causes of rank defects in words, and the errors that carry them."""

from dataclasses import dataclass
from enum import StrEnum

from rig.errors import SvevError


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
        message: in words, ending in what to do.
        points: names of the points concerned.
        images: names of the images concerned.
    """

    kind: DefectKind
    defect: int
    message: str
    points: tuple[str, ...] = ()
    images: tuple[str, ...] = ()


class NotSolvableError(SvevError):
    """The network does not determine its unknowns; `defects` names them and the causes."""

    exit_code = 3

    def __init__(self, defects: tuple[Defect, ...]):
        super().__init__("; ".join(defect.message for defect in defects))
        self.defects = defects


class NotConvergedError(SvevError):
    """The iteration did not reach an optimum."""

    exit_code = 4


class RefusedError(SvevError):
    """There is an optimum, but its data contradict each other so much that it must not be used."""

    exit_code = 4
