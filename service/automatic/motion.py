"""Finds a jumper who enters a region of a camera's image, and nothing else: no snow, no cloud, no swaying tree.

The region is divided into cells. Of every cell mean and usual deviation are tracked, after a change of the light on
the whole region is divided out. What moves is a connected group of cells, larger than any flake, that deviate far more
than they usually do, and that is somewhere else in the next image.
"""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

#: Cells along the longer side of the region.
_CELLS_ALONG_SIDE: Final = 40
#: A cell deviates if it differs by so many of its usual deviations, and of grey values at least.
_DEVIATIONS: Final = 6.0
_LEAST_GREY: Final = 6.0
#: Noise of a cell's mean at least, grey values.
_LEAST_SIGMA: Final = 0.5
_SIGMA_OF_MEAN_DEVIATION: Final = 1.25
#: How fast the usual image follows, s: cells that agree, and cells that deviate (a new thing, left there).
_FOLLOW_S: Final = 3.0
_FOLLOW_NEW_S: Final = 20.0
#: Nothing is found before the usual image is known for so long, s.
_LEARN_S: Final = 2.0
#: More of the region does not move at once: that is light.
_MOST_MOVING: Final = 0.5
#: What moves covers other cells in the next image: this share of its cells at least.
_NEW_CELLS: Final = 0.25
#: Images farther apart than this do not show the same motion, s.
_SAME_MOTION_S: Final = 0.5


@dataclass(frozen=True, slots=True)
class _Group:
    """The largest group of cells that deviate, of which `mask` is true, and when it was seen."""

    mask: NDArray[np.bool_]
    time_s: float


class MotionDetector:
    """Looks at one image after the other.

    Args:
        least_share: share of the region that a jumper covers at least.
    """

    def __init__(self, least_share: float) -> None:
        self._least_share = least_share
        self._usual: NDArray[np.float32] | None = None
        self._deviation: NDArray[np.float32] = np.zeros((0, 0), np.float32)
        self._began = self._last = 0.0
        self._before: _Group | None = None

    def forget(self) -> None:
        """Learn the usual image anew: images were missed, or the cameras were set up again."""
        self._usual = self._before = None

    def look(self, region: NDArray[np.uint8], time_s: float) -> bool:
        """Look at the next image.

        Args:
            region: (rows, columns), the same ones in every image.
            time_s: when it was exposed, s.

        Returns:
            Whether something moves there.
        """
        cells = _cells(region)
        if self._usual is None or self._usual.shape != cells.shape:
            self._usual, self._deviation = cells, np.full_like(cells, _LEAST_GREY)
            self._began = self._last = time_s
            return False
        light = float(np.median(cells / np.maximum(self._usual, 1.0)))
        cells /= max(light, 0.01)
        off = np.abs(cells - self._usual)
        sigma = np.maximum(_SIGMA_OF_MEAN_DEVIATION * self._deviation, _LEAST_SIGMA)
        deviates = off > np.maximum(_DEVIATIONS * sigma, _LEAST_GREY)
        group = self._largest(deviates, time_s)
        moves = group is not None and time_s - self._began > _LEARN_S and self._has_moved(group)
        self._before = group
        # The usual image follows slowly where something new is, so that a jumper leaves no trace in it.
        seconds, self._last = time_s - self._last, time_s
        share = np.where(deviates, -np.expm1(-seconds / _FOLLOW_NEW_S), -np.expm1(-seconds / _FOLLOW_S))
        self._usual += share * (cells - self._usual)
        self._deviation += share * (off - self._deviation)
        return moves

    def _largest(self, deviates: NDArray[np.bool_], time_s: float) -> _Group | None:
        count, labels, sizes, _ = cv2.connectedComponentsWithStats(deviates.astype(np.uint8), connectivity=8)
        if count < 2:  # the first one is the rest of the region
            return None
        best = 1 + int(np.argmax(sizes[1:, cv2.CC_STAT_AREA]))
        cells = int(sizes[best, cv2.CC_STAT_AREA])
        if not self._least_share * deviates.size <= cells <= _MOST_MOVING * deviates.size:
            return None
        return _Group(np.asarray(labels == best), time_s)

    def _has_moved(self, group: _Group) -> bool:
        """Whether the group has come to new cells since the image before; a lamp that goes on stays where it is."""
        before = self._before
        if before is None or group.time_s - before.time_s > _SAME_MOTION_S:
            return False
        return bool(np.count_nonzero(group.mask & ~before.mask) >= _NEW_CELLS * np.count_nonzero(group.mask))


def _cells(region: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Mean grey of every cell."""
    rows, columns = region.shape
    edge = max(1.0, max(rows, columns) / _CELLS_ALONG_SIDE)
    size = (max(1, round(columns / edge)), max(1, round(rows / edge)))
    return cv2.resize(region, size, interpolation=cv2.INTER_AREA).astype(np.float32)
