"""Tells the parts of images that hardly move from those that may hold a jumper.

Somebody with skis of 2.5 m who moves by 12 m/s at least leaves half of the box around him within a tenth of a second.
Officials, spectators, flags and trees stay where they are. So does the image of somebody who moves along the camera's
axis, or of a jumper behind a tree: a region that is still is searched less, but never left out.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final

import numpy as np

from analysis.candidates.foreground.background import Region
from rig.arrays import Flags, Floats
from rig.clocks import NS_PER_S, UtcNs

_WITHIN_S: Final = 0.1
_IN_COMMON: Final = 0.6  #: of two boxes, share of their area in common; a jumper's have a third


class Pace:
    """Where something was in front in the last images of one camera."""

    def __init__(self) -> None:
        self._boxes: deque[tuple[UtcNs, Floats]] = deque()

    def still(self, time: UtcNs, regions: Sequence[Region]) -> Flags:
        """Which regions of the next image were in the same places a moment ago; none without an image of that time.

        Args:
            time: of the image, later than those before.
            regions: of it.
        """
        boxes = np.array([(r.x, r.y, r.x + r.grey.shape[1], r.y + r.grey.shape[0]) for r in regions], float)
        self._boxes.append((time, boxes.reshape(-1, 4)))
        while len(self._boxes) > 1 and time - self._boxes[1][0] >= _WITHIN_S * NS_PER_S:
            self._boxes.popleft()
        then, before = self._boxes[0]
        if not _WITHIN_S * NS_PER_S <= time - then < 2 * _WITHIN_S * NS_PER_S:
            return np.zeros(len(regions), bool)
        return np.asarray((_in_common(boxes.reshape(-1, 1, 4), before) > _IN_COMMON).any(axis=1))


def _in_common(one: Floats, other: Floats) -> Floats:
    """Area that boxes (..., 4) (left, top, right, bottom) have in common, share of what both cover together."""
    low, high = np.maximum(one[..., :2], other[..., :2]), np.minimum(one[..., 2:], other[..., 2:])
    both = np.maximum(high - low, 0.0).prod(axis=-1)
    areas = [(box[..., 2:] - box[..., :2]).prod(axis=-1) for box in (one, other)]
    return np.asarray(both / (areas[0] + areas[1] - both))
