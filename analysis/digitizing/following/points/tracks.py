"""What goes into a track and what comes out of it."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from analysis.digitizing.following.points.candidates import Origin
from analysis.measurements.model import PointMeasurement
from rig.arrays import Floats
from rig.images.picture import Grey
from rig.phrase import NOTHING, Phrase, phrase

#: The track ends where its order ends.
FAR: Final = phrase("hand_far", "it was tracked as far as was asked")


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """A mark by hand.

    Attributes:
        xy: (2,) px.
        sigma: (2,) px.
    """

    xy: Floats
    sigma: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Tracked:
    """A place in one image.

    Attributes:
        xy: (2,) px.
        sigma: (2,) px: of the mark that it goes back to, of the matches since, and of its own.
        origin: match or automatic measurement.
    """

    xy: Floats
    sigma: Floats
    origin: Origin


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """What was tracked.

    Attributes:
        places: by pulse and camera; without those that are marked by hand.
        stopped: why it ends.
        last: the last pulse with a place; the first one of all if there is none.
        velocity: (3,) m/s at the start, for other things of the same jumper; None of an image by itself.
    """

    places: Mapping[int, Mapping[str, Tracked]]
    stopped: Phrase
    last: int
    velocity: Floats | None


Frames = Callable[[int], Mapping[str, Grey]]
Automatic = Callable[[int], Mapping[str, PointMeasurement]]


def one_after_another(said: Iterable[Phrase]) -> Phrase:
    """Sentences as one, each once; nothing of none."""
    one, *others = {each.text: each for each in said}.values() or (NOTHING,)
    for other in others:
        one = phrase("hand_and", "{one}; {other}", one=one, other=other)
    return one
