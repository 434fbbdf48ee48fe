"""Whether targets move from picture to picture, and when they are still in a pose of which there is no picture yet."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from analysis.targets.detection import Sight
from analysis.targets.network_of import FEWEST_CORNERS

#: Of the picture's diagonal, that the target must have moved between two pictures of one camera.
MOVED: Final = 0.03
#: Median shift (px) of the corners from one live picture to the next, a tenth of a second later or more, below which
#: the target is still: in an exposure of 10 ms it moves by a twentieth of a pixel, a few times a corner's sigma.
_STILL_PX: Final = 0.5
_STILL_TIMES: Final = 2


def shift(one: Sight, other: Sight) -> float:
    """Median distance (px) between the same corners of two pictures; infinite if they share few."""
    common = one.corners.keys() & other.corners.keys()
    if len(common) < FEWEST_CORNERS:
        return np.inf
    moves = [np.hypot(one.corners[k].x - other.corners[k].x, one.corners[k].y - other.corners[k].y) for k in common]
    return float(np.median(moves))


def shows_enough(sight: Sight) -> bool:
    """Whether a picture shows corners enough to be worth keeping."""
    return len(sight.corners) >= FEWEST_CORNERS


class Watch:
    """Looks at live pictures of all cameras, pulse after pulse, and says when to keep one.

    All cameras that show the target count: while it moves in one of them nothing is kept.

    Attributes:
        still: whether the target has been still for some pictures.
    """

    def __init__(self) -> None:
        self.still = False
        self._last: Mapping[str, Sight] = {}
        self._kept: Mapping[str, Sight] = {}
        self._times = 0

    def look(self, seen: Mapping[str, Sight], kept: Mapping[str, Sequence[Sight]]) -> frozenset[str]:
        """Look at the pictures of a pulse.

        Args:
            seen: by camera, what the pictures of this pulse show.
            kept: by camera, what the pictures show that have been kept so far.

        Returns:
            The cameras whose pictures are to be kept: all that show the target, if one shows it in a new pose. A
            target that has not been moved since the last picture was kept stays unkept, also if that was thrown away.
        """
        there = {name: sight for name, sight in seen.items() if shows_enough(sight)}
        moved = [shift(sight, self._last[name]) if name in self._last else np.inf for name, sight in there.items()]
        self._last = there
        self._times = self._times + 1 if there and max(moved) <= _STILL_PX else 0
        self.still = self._times >= _STILL_TIMES
        if not self.still or not any(self._is_new(name, sight, kept.get(name, ())) for name, sight in there.items()):
            return frozenset()
        self._kept = there
        return frozenset(there)

    def _is_new(self, name: str, sight: Sight, kept: Sequence[Sight]) -> bool:
        least = MOVED * float(np.hypot(*sight.size))
        others = [*kept, *([self._kept[name]] if name in self._kept else [])]
        return all(shift(sight, other) > least for other in others)
