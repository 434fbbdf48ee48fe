"""What became of each point and ski in each pulse: used, or why there is no raw solution; and likewise of each image.

The members of `jumper.json` beside `points` and `skis` have the same names.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum


class Fate(StrEnum):
    """What became of a point or a ski in the raw solution of a pulse."""

    USED = "used"  #: it has a raw solution
    OUT_OF_SIGHT = "out of sight"  #: in the pictures of fewer than two cameras
    NOT_FOUND = "not found"  #: measured in fewer than two images, though more pictures contain its place
    UNDETERMINED = "not determined"  #: the rays or planes coincide within their accuracy
    DISAGREE = "images disagree"  #: they contradict each other, and no single one of them is the wrong one
    MOTION = "motion disagrees"  #: too few images control it, and the motion of the whole jump contradicts it
    NAME = "name uncertain"  #: it may be another thing on the jumper


class ImageFate(StrEnum):
    """What became of a point or a ski in one image."""

    USED = "used"
    RAW_ONLY = "raw only"  #: used in the raw solution; the model over time left it out as a gross error
    GROSS_ERROR = "gross error"  #: it contradicts the other images
    NOT_USED = "not used"  #: measured, but the point or the ski has no raw solution
    NOT_FOUND = "not found"
    OUT_OF_SIGHT = "out of sight"
    NO_FRAME = "no frame"


@dataclass(frozen=True, slots=True)
class PartFate:
    """What became of a point or a ski in a pulse.

    Attributes:
        fate: in the raw solution.
        images: by oriented camera.
    """

    fate: Fate
    images: Mapping[str, ImageFate]
